"""Patches of the panel with independent scintillation of the same law and correlation time.

Patch n (row by row) at symbol t draws two normal numbers with counter (n, 0, t, 0), so its factor
depends only on the seed, n and t. Patches have edges, unlike real air. The law at a point, its
course in time, and the scintillation of large areas are correct (`scintillation.patch_side`).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from link.air.geometry import lengths
from link.air.motion import normal_draws
from link.air.scintillation import Flicker, flicker, patch_side
from link.air.setting import AirSetting, Optics

Values = npt.NDArray[np.float64]
_CHUNK: Final = 1 << 14
_SYMBOLS: Final = 64
"""Largest number of draws, and of symbols, that are computed at once."""


class Patches:
    """Uniform grid of patches on the panel.

    Args:
        panel: (height, width), pixels.
        pitch: pitch of the panel's pixels, m.
        side: smallest side of a patch, m; along each axis as many patches as fit, at least one.

    Attributes:
        shape: (rows, columns) of patches.
    """

    def __init__(self, panel: tuple[int, int], pitch: float, side: float) -> None:
        rows, columns = (
            max(min(math.floor(n * pitch / side) if side > 0 else n, n), 1) for n in panel
        )
        self.shape = rows, columns
        self._bands = [n * panel[0] // rows for n in range(rows + 1)]
        self._widths = np.diff([n * panel[1] // columns for n in range(columns + 1)])

    @property
    def count(self) -> int:
        return self.shape[0] * self.shape[1]

    def multiply(self, light: npt.NDArray[np.float32], factors: Values) -> None:
        """Multiplies light (height, width) by the factor of each patch, (count,), in place."""
        by = factors.astype(np.float32).reshape(self.shape)
        if self.count == 1:
            light *= by[0, 0]
            return
        for row, (first, stop) in enumerate(zip(self._bands[:-1], self._bands[1:], strict=True)):
            light[first:stop] *= np.repeat(by[row], self._widths)


class FlickerSeries:
    """Factors of the patches, symbol by symbol: an Ornstein-Uhlenbeck process in each patch.

    Symbols are computed in order. A symbol before those in memory is computed from the beginning,
    with the same bits.

    Args:
        law: law of the factors.
        seconds: duration of a symbol.
        patches: number of patches.
        seed: seed below 2^32.
    """

    def __init__(self, law: Flicker, seconds: float, patches: int, seed: int) -> None:
        self._law, self._patches, self._seed = law, patches, seed
        self._decay = math.exp(-seconds / law.time)
        self._gain = math.sqrt(-math.expm1(-2 * seconds / law.time))
        self._step = max(min(_CHUNK // patches, _SYMBOLS), 1)
        self._constant = np.ones(patches)
        self._first, self._last = 0, np.zeros((patches, 2))
        self._factors = np.zeros((0, patches))

    def __getitem__(self, symbol: int) -> Values:
        """Factors of a symbol, (patches,) float64."""
        if symbol < 0:
            raise IndexError(f"symbol must be 0 or more, not {symbol}")
        if self._law.index <= 0:
            return self._constant
        if symbol < self._first:
            self._first, self._factors = 0, self._factors[:0]
        while symbol >= self._first + len(self._factors):
            self._advance()
        return np.asarray(self._factors[symbol - self._first])

    def _advance(self) -> None:
        """Computes the next symbols."""
        first = self._first + len(self._factors)
        draws = normal_draws(
            self._seed, Stream.SCINTILLATION, np.arange(self._patches), self._step, first
        )
        for n in range(self._step):
            if first + n:  # the first symbol has the stationary law
                draws[n] = self._decay * self._last + self._gain * draws[n]
            self._last = draws[n]
        factors = self._law.factors(draws.reshape(-1, 2))
        self._first, self._factors = first, factors.reshape(self._step, self._patches)


def flicker_of(optics: Optics, air: AirSetting) -> tuple[Flicker, Patches]:
    """Law of scintillation of what a camera pixel images, and the panel's patches.

    The field of a camera pixel is taken as a disc of equal area. Blur would average more and is
    neglected.
    """
    pixel = air.distance / lengths(optics, air.distance).camera
    optical = optics.wavelength_nm, air.distance, optics.focal_length / optics.f_number
    disc = 2 / math.sqrt(math.pi) * pixel
    law = flicker(air.structure, *optical, air.wind, disc)
    side = patch_side(optical[2], *optical[:2], disc) if law.index > 0 else math.inf
    return law, Patches((optics.height, optics.width), optics.pitch, side)
