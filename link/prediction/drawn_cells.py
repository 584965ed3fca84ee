"""Random light on the pixels of a cell: what the estimates of its errors have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from link.air.kernel import Psf, kernel_table, taps
from link.detect.geometry import LEAST, PLACES, SHARES
from link.mode import Mode
from link.prediction.error_bound import CellScene, edge_share

_PHASES: Final = 32
"""Sub-pixel positions of the table of weights."""
Values = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CellSight:
    """Input of `cell_errors`.

    Attributes:
        scene: light and threshold; its blur and phase are not read.
        affine: (2, 2) camera pixels for a step of one panel pixel, in x and y.
        psf: point-spread function of the whole optical path.
        blur: standard deviation that the detector assumes, camera pixels.
        phases: delays of symbols after the latch for representative rows and symbols, ticks.
    """

    scene: CellScene
    affine: Values
    psf: Psf
    blur: float
    phases: Values

    @cached_property
    def table(self) -> npt.NDArray[np.float32]:
        """Weights of panel pixels by sub-pixel position, from `kernel_table`."""
        count = taps(self.affine, self.psf)
        return kernel_table(self.affine, self.psf, count, _PHASES)


@dataclass(frozen=True)
class Mixed(Psf):
    """Point spread function of a lens and of a sensor with cross-talk.

    Attributes:
        to_each_side: share of a pixel's light that goes to each neighbour.
    """

    to_each_side: float = 0.0

    def mtf(self, fx: Values, fy: Values) -> Values:
        a = self.to_each_side
        x, y = (1 - 2 * a + 2 * a * np.cos(2 * np.pi * f) for f in (fx, fy))
        return np.asarray(super().mtf(fx, fy) * x * y)


@dataclass(frozen=True)
class CellErrors:
    """Estimated error rate of cells.

    Attributes:
        rate: raw bit error rate.
        low, high: 99.9 % limits of the random draws, low at least 0.
        promise: mean of 1 / (1 + e^|L|), the rate according to the soft values.
    """

    rate: float
    low: float
    high: float
    promise: float


def random_bits(rng: np.random.Generator, shape: tuple[int, ...], longest: int) -> Flags:
    """Random bits whose runs along the last axis have at most `longest` bits."""
    out = rng.random(shape) < 0.5
    if longest >= shape[-1]:
        return out
    run = np.ones(shape[:-1], np.int64)
    for n in range(1, shape[-1]):
        same = out[..., n] == out[..., n - 1]
        out[..., n] ^= same & (run >= longest)
        run = np.where(out[..., n] == out[..., n - 1], run + 1, 1)
    return out


def own_bits(bits: Flags) -> Flags:
    """Bits of the cells in the middle, (cells, symbols)."""
    return bits[:, bits.shape[1] // 2, bits.shape[2] // 2]


@dataclass(frozen=True, eq=False)
class CellPixels:
    """Camera pixels of cells that lie at one of the detector's sub-pixel positions.

    Attributes:
        points: (cells, pixels, 2) camera (x, y) from the cell's centre.
        share: (pixels,) the detector's class of their share of light from the cell.
        around: cells on each side whose light they may see.
    """

    points: Values
    share: npt.NDArray[np.intp]
    around: int


def cell_pixels(
    sight: CellSight, mode: Mode, place: tuple[int, int], count: int, most: int,
    rng: np.random.Generator,
) -> CellPixels:  # fmt: skip
    """Pixels of `count` cells anywhere within a sub-pixel position, at most `most` of each: those
    with the largest shares."""
    side = mode.cell * sight.scene.pixel
    reach = math.ceil(side / 2 + 1)
    around = max(math.ceil((1.5 + 3 * sight.blur) / side), 1)
    pixels = np.arange(-reach, reach + 1.0)
    half = side / 2
    middle = [(p + 0.5) / PLACES - 0.5 for p in place]
    named = [
        edge_share(pixels - m + half, sight.blur) - edge_share(pixels - m - half, sight.blur)
        for m in middle
    ]
    known = (named[0][:, None] * named[1]).ravel()
    order = np.argsort(-known)[: min(max(int((known >= LEAST).sum()), 1), most)]
    y, x = np.divmod(order, pixels.size)
    exact = np.stack([m + (rng.random(count) - 0.5) / PLACES for m in middle[::-1]], axis=1)
    points = np.stack([pixels[x], pixels[y]], axis=1) - exact[:, None]
    share = np.minimum((known[order] * SHARES).astype(np.intp), SHARES - 1)
    return CellPixels(points, share, around)


def light_on_pixels(sight: CellSight, cell: int, seen: CellPixels, bits: Flags) -> Values:
    """Share of the light that is on at camera pixels, (cells, pixels, symbols).

    Args:
        sight: the optics.
        cell: side of a cell, panel pixels.
        seen: the pixels.
        bits: (cells, rows, columns, symbols) of the cells around.
    """
    around, points = seen.around, seen.points
    table = sight.table
    phases, count = table.shape[1:3]
    panel = points @ np.linalg.inv(sight.affine).T + (cell - 1) / 2
    whole = np.floor(panel).astype(np.intp)
    part = ((panel - whole) * phases).astype(np.intp)
    weights = table[part[..., 1], part[..., 0]]  # (cells, pixels, count, count)
    step = np.arange(count) - (count // 2 - 1)
    at = (whole[..., None] + step) // cell + around
    at = np.clip(at, 0, 2 * around)
    n = np.arange(len(bits))[:, None, None, None]
    lit = bits[n, at[..., 1, :, None], at[..., 0, None, :]]
    return np.einsum("npyx,npyxs->nps", weights, lit, dtype=np.float64)
