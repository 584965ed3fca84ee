"""Information that a link's cells carry, by simulation: an achievable figure beside the bound.

A strip of the panel shows random bits through the link's air and camera (`link.setup.pilot`). The
detector's soft values give the generalised mutual information of a bit, which a code that decides
by them can reach (`link.theory.soft_information`); times the symbols of all data cells it is a
rate. The receiver's estimates of place and time are those of the strip: known, but for the
vibration. Bits are random and independent: a line code can only lower the figure.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from link.layout import Layout
from link.mode import CELLS, Mode, ticks_chosen
from link.setting import LinkSetting
from link.setup.pilot import film_pilot, strip_of
from link.setup.truth import panel_in_view, tag_module
from link.theory.soft_information import SoftInformation, soft_information

LINE: Final = "scrambled"
"""Line of the pilots: random bits, and training of random bits."""
_BATCHES: Final = 64
"""Bands of rows whose means give the interval: bits in a band share pixels and their fixed
pattern. The position of cells between the pixels repeats over the strip, so that its share of the
spread between bands makes the interval wider than need be."""


def can_be_read(setting: LinkSetting, mode: Mode) -> bool:
    """Whether a receiver can find the panel: all of it in view, tags large enough."""
    module, least = tag_module(setting, mode)
    return panel_in_view(setting) and module >= least


@dataclass(frozen=True)
class Achievable:
    """Information of a mode.

    Attributes:
        mode: the mode.
        raw_bps: a bit of every data cell in every symbol, bit/s.
        sent: bits of the pilot.
        bit: information of a bit, with its 99.9 % interval.
    """

    mode: Mode
    raw_bps: float
    sent: int
    bit: SoftInformation

    @property
    def rates(self) -> tuple[float, float, float]:
        """Information of all data cells and the ends of its interval, bit/s."""
        return (
            self.raw_bps * self.bit.bits, self.raw_bps * self.bit.low, self.raw_bps * self.bit.high
        )  # fmt: skip


class CellInformation:
    """Information of modes of one link; each cell and symbol length is simulated once.

    Attributes:
        found: what has been simulated, by (cell, ticks).
    """

    def __init__(
        self, setting: LinkSetting, mode: Mode, detector: str, symbols: int, seed: int
    ) -> None:
        """Prepares.

        Args:
            setting: the link.
            mode: mode of the transmission; other modes differ from it in cell, ticks and line.
            detector: name, of `link.detect.catalogue.DETECTORS`.
            symbols: number of symbols of random data that a pilot decides.
            seed: seed of the data.
        """
        self._setting, self._mode, self._detector = setting, mode, detector
        self._symbols, self._seed = symbols, seed
        self.found: dict[tuple[int, int], Achievable] = {}

    @cached_property
    def _strip(self) -> LinkSetting:
        return strip_of(self._setting)

    def _raw(self, cell: int, ticks: int) -> float:
        mode = replace(self._mode, cell=cell, ticks=ticks, line=LINE)
        return Layout(mode).cells * self._setting.panel.clock.hz / ticks

    def of(self, cell: int, ticks: int) -> Achievable:
        """Information of a cell and a symbol length."""
        if (cell, ticks) not in self.found:
            mode = replace(self._mode, cell=cell, ticks=ticks, line=LINE)
            narrow = replace(mode, width=self._strip.optics.width)
            pilot = film_pilot(self._strip, narrow, self._detector, self._seed, None, self._symbols)
            layout = Layout(narrow)
            band = layout.data // layout.shape[1] * _BATCHES // layout.shape[0]
            bands = np.broadcast_to(band, pilot.soft.shape)
            bit = soft_information(pilot.soft.ravel(), pilot.sent.ravel(), bands.ravel())
            assert bit is not None
            self.found[cell, ticks] = Achievable(mode, self._raw(cell, ticks), pilot.sent.size, bit)
        return self.found[cell, ticks]

    def best(
        self, cells: Iterable[int] = CELLS, ticks: Iterable[int] = ticks_chosen(LINE)
    ) -> Achievable:
        """Mode with the highest information of these.

        A mode is not simulated where it cannot be the best: if its raw rate is no higher, or if a
        mode with cells and symbols at least as large carries too little in a bit. A bit of a
        larger cell or a longer symbol is taken to carry no less.
        """
        lengths = tuple(ticks)
        left = sorted(((c, t) for c in cells for t in lengths), key=lambda m: self._raw(*m))
        if not left:
            raise ValueError("cells and ticks must hold at least one mode, not none")
        best = None
        while left:
            known = [m for m in left if m in self.found]
            now = self.of(*(known[0] if known else left[len(left) // 2]))
            if best is None or now.rates[0] > best.rates[0]:
                best = now
            least = best.rates[0]
            left = [m for m in left if m != _key(now) and self._most(*m) > least]
        assert best is not None
        return best

    def _most(self, cell: int, ticks: int) -> float:
        """An upper limit of a mode's information, bit/s, by those that are known."""
        bits = [
            one.bit.high for one in self.found.values()
            if one.mode.cell >= cell and one.mode.ticks >= ticks
        ]  # fmt: skip
        return self._raw(cell, ticks) * min(bits, default=1.0)


def _key(one: Achievable) -> tuple[int, int]:
    return one.mode.cell, one.mode.ticks
