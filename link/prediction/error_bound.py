"""A bound on the error rate of a cell, from geometry and closed forms.

A cell is observed by its camera pixels in its ticks. The charge of an observation is normal about
its mean: the cell's share of the light, the neighbours' (each on half of the time), and the
background. With P(spike | on) = p and P(spike | off) = q of an observation, independent
observations whose log likelihood ratios are added have an error probability of at most 1/2
prod(sqrt(p q) + sqrt((1 - p) (1 - q))), the Bhattacharyya bound (Kailath, IEEE Trans. Commun.
Technol. 15:52, 1967). Observations are not fully independent, and turbulence, fixed pattern and
drift are not included. The result is therefore an estimate, which a run may exceed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from link.mode import Mode
from link.theory import Reset

_PLACES = 5
"""Positions of a camera pixel within the cell's grid, along each axis, that are averaged."""
_WORTH = 1e-3
"""Share of its cell's light below which an observation is not counted."""
_ALIVE = 1e-12
"""Probability of no spike so far below which all pixels are taken to have fired."""
LEAST_CELL = 1.2
"""Smallest side of a cell that a run chooses itself, camera pixels: closer to 1, the beat of both
grids leaves cells without a pixel of their own."""
_UNCODED_RUN = 8
"""Assumed longest run of equal symbols if the code does not limit runs."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CellScene:
    """Light of a link's cells, and the camera's pixel.

    Attributes:
        pixel: camera pixels for a panel pixel.
        blur: standard deviation of the image's blur, camera pixels.
        on, background: electrons of a tick over the threshold.
        threshold: electrons.
        noise: standard deviation of the threshold, electrons.
        reset: reset rule of the camera.
        phase: delay of symbols after the latch, ticks.
    """

    pixel: float
    blur: float
    on: float
    background: float
    threshold: float
    noise: float
    reset: Reset
    phase: float


def longest_run(mode: Mode) -> int:
    """Assumed longest run of equal symbols."""
    return mode.code.run_limit or _UNCODED_RUN


def edge_share(x: Values, blur: float) -> Values:
    """Share of a camera pixel at x beyond a blurred edge at 0.

    It is the integral of the normal distribution over the pixel.
    """
    from scipy.special import ndtr

    if blur <= 0:
        return np.clip(x + 0.5, 0.0, 1.0)

    def primitive(y: Values) -> Values:
        z = y / blur
        out: Values = y * ndtr(z) + blur / math.sqrt(2 * math.pi) * np.exp(-z * z / 2)
        return out

    return primitive(x + 0.5) - primitive(x - 0.5)


def _shares(side: float, blur: float) -> Values:
    """Share of each pixel's light along a line that its cell brings, (places, pixels).

    Args:
        side: length of a cell, camera pixels.
        blur: standard deviation, camera pixels.
    """
    reach = math.ceil(side / 2 + 3 * blur + 1)
    pixels = np.arange(-reach, reach + 1)
    place = (np.arange(_PLACES) + 0.5) / _PLACES - 0.5
    at = pixels + place[:, None]
    return edge_share(at + side / 2, blur) - edge_share(at - side / 2, blur)


def _fires(scene: CellScene, mean: Values, spread: Values, run: int) -> Values:
    """P(spike in a tick).

    Args:
        scene: the pixel.
        mean: electrons of a tick over the threshold.
        spread: standard deviation of the neighbours' part of it.
        run: ticks over which charge may have accumulated.
    """
    from scipy.special import ndtr

    if scene.reset != "hard":  # with carried charge, the mean rate is the probability
        return np.clip(mean, 0.0, 1.0)
    q, total, alive, out = scene.threshold, 0.0, np.ones_like(mean), np.zeros_like(mean)
    before = np.zeros_like(mean)
    for tick in range(1, run + 1):  # ticks of a dark run, all equally likely
        width = np.sqrt(tick * np.maximum(mean, 1e-12) / q + (scene.noise / q) ** 2
                        + tick * spread**2)  # fmt: skip
        full = np.maximum(ndtr((tick * mean - 1) / width), before)
        # If all have fired, the light fills the threshold in every tick: they fire again.
        out += np.where(alive > _ALIVE, (full - before) / np.maximum(alive, _ALIVE), 1.0)
        alive, before, total = np.maximum(1 - full, 1e-300), full, total + 1
    return np.clip(out / total, 0.0, 1.0)


def predict_errors(scene: CellScene, mode: Mode) -> float:
    """An estimate of the raw bit error rate of the joint decision.

    It is the Bhattacharyya bound of a model with independent observations and normal light of the
    neighbours.
    """
    if scene.blur > mode.cell * scene.pixel:  # the neighbours contribute more than the cell
        return 0.5
    shares = _shares(mode.cell * scene.pixel, scene.blur)
    ticks = np.concatenate([[1 - scene.phase], np.ones(mode.ticks - 1), [scene.phase]])
    mine = shares[:, None, :, None, None] * shares[None, :, None, :, None] * ticks
    # The remaining light comes mostly from four neighbours.
    rest = 1 - mine
    spread = scene.on * rest / 2 / 2
    run = min(longest_run(mode) * mode.ticks, 64)
    base = scene.background + scene.on * rest / 2
    on = _fires(scene, base + scene.on * mine, spread, 1)
    off = _fires(scene, base, spread, run)
    factor = np.sqrt(on * off) + np.sqrt((1 - on) * (1 - off))
    factor = np.where(mine > _WORTH, np.minimum(factor, 1.0), 1.0)
    product = np.exp(np.log(np.maximum(factor, 1e-30)).sum(axis=(2, 3, 4)))
    return float(0.5 * product.mean())
