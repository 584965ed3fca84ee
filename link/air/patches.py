"""The panel in patches of air: each flickers on its own, with the law and the time of all.

Patch n (row by row) at symbol t draws two normal numbers of counter (n, 0, t, 0): what it does
depends on the seed, its number and the symbol alone. Patches have edges, real air has none: what is
right is the law at a point, the course in time, and how little large areas flicker as a whole
(`scintillation.patch_side`).
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

__all__ = ["FlickerSeries", "Patches", "flicker_of"]

Values = npt.NDArray[np.float64]
_CHUNK: Final = 1 << 14
_SYMBOLS: Final = 64
"""Draws, and symbols, that are made at once, at most."""


class Patches:
    """An even grid on the panel, as many along each side as have room for `side`, one at least.

    panel: (height, width) pixels. pitch, side: m. shape: (rows, columns) of patches.
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
        """The panel's light (height, width) times each patch's own of (count,), in place."""
        by = factors.astype(np.float32).reshape(self.shape)
        if self.count == 1:
            light *= by[0, 0]
            return
        for row, (first, stop) in enumerate(zip(self._bands[:-1], self._bands[1:], strict=True)):
            light[first:stop] *= np.repeat(by[row], self._widths)


class FlickerSeries:
    """The patches' factors, symbol by symbol. seconds: of a symbol. seed: below 2^32. One that lies
    before the last ones asked for is made from the beginning, with the same bits."""

    def __init__(self, law: Flicker, seconds: float, patches: int, seed: int) -> None:
        self._law, self._patches, self._seed = law, patches, seed
        self._stays = math.exp(-seconds / law.time)
        self._new = math.sqrt(-math.expm1(-2 * seconds / law.time))
        self._step = max(min(_CHUNK // patches, _SYMBOLS), 1)
        self._still = np.ones(patches)
        self._first, self._last = 0, np.zeros((patches, 2))
        self._made = np.zeros((0, patches))

    def __getitem__(self, symbol: int) -> Values:
        """(patches,) of a symbol from 0 on."""
        if symbol < 0:
            raise IndexError(f"symbol must be 0 or more, not {symbol}")
        if self._law.index <= 0:
            return self._still
        if symbol < self._first:
            self._first, self._made = 0, self._made[:0]
        while symbol >= self._first + len(self._made):
            self._advance()
        return np.asarray(self._made[symbol - self._first])

    def _advance(self) -> None:
        """Makes the next symbols, an Ornstein-Uhlenbeck process in each patch."""
        first = self._first + len(self._made)
        draws = normal_draws(
            self._seed, Stream.SCINTILLATION, np.arange(self._patches), self._step, first
        )
        for n in range(self._step):
            if first + n:  # the first is of the stationary law
                draws[n] = self._stays * self._last + self._new * draws[n]
            self._last = draws[n]
        factors = self._law.factors(draws.reshape(-1, 2))
        self._first, self._made = first, factors.reshape(self._step, self._patches)


def flicker_of(optics: Optics, air: AirSetting) -> tuple[Flicker, Patches]:
    """How the light of what a camera pixel sees of the panel flickers, and the panel's patches that
    do so on their own. What a pixel sees is taken as a disc of its area, blur left aside, which
    would average more."""
    pixel = air.distance / lengths(optics, air.distance).camera
    optical = optics.wavelength_nm, air.distance, optics.focal_length / optics.f_number
    disc = 2 / math.sqrt(math.pi) * pixel
    law = flicker(air.structure, *optical, air.wind, disc)
    side = patch_side(optical[2], *optical[:2], disc) if law.index > 0 else math.inf
    return law, Patches((optics.height, optics.width), optics.pitch, side)
