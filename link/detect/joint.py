"""Joint soft decision over the pixels of a cell, the ticks of a symbol and neighbouring symbols.

Given a symbol's bit and the previous one, the pixels of a cell are taken to spike independently, so
the log likelihoods of all its pixels and ticks add up. A forward and a backward pass over the chain
of a cell's bits then gives the value of each bit. The likelihoods depend on the pixels' class and
are learned from known symbols; nothing about the sensor or the light is assumed. A tick shared by
two symbols therefore informs both, and so does charge carried into the next symbol.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import by_rows
from cosim.spikes.viform import Words
from link.detect import tables as learned
from link.detect.counting import CONTEXT, PAIRS, PART, PHASES, RUN, add_evidence, count_patterns
from link.detect.detector import LIMIT, Bits, Soft, bits_held
from link.detect.geometry import SHARES, CellImages, cell_centres, cell_images
from link.detect.tables import Tables, parts_for
from link.layout import PERIOD, Layout, pilots
from link.timing import Registration, Timing

AROUND: Final = 2
"""Symbols before and after the requested ones that the chain includes."""

EDGE: Final = 1 / 32
"""Distance of a symbol's begin from a tick edge, ticks, within which it is moved: a quarter of a
class of phase."""
_MOVED: Final = 2 * EDGE
"""Ticks by which it is moved. It may then drift by as much before it falls into the tick before,
whose laws are worse: they know the bit before and that of the symbol, but the spikes of that tick
depend on the charge of the two bits before. Measured at 8 m: .0475 of the bits wrong instead of
.055."""
Values = npt.NDArray[np.float64]


class Joint:
    """The joint detector; see `Detector`.

    Symbols more than two away from a call's first and last symbol are neglected. Their influence is
    small: ticks wholly within one symbol separate the chain.

    Attributes:
        timing: time of the symbols.
        ticks: ticks of a symbol.
        cells: images of the data cells.
        delay: ticks by which all begins are delayed. Symbols that begin with a tick would otherwise
            fall into the previous tick after a tiny drift, a class without training data.
    """

    def __init__(
        self, layout: Layout, registration: Registration, timing: Timing, pixel: object = None
    ) -> None:
        self._layout, self.ticks = layout, layout.mode.ticks
        self.cells = cell_images(layout, registration)
        self._place(registration, timing)
        shape = (
            self.cells.regions, PHASES, parts_for(self.ticks), SHARES, PAIRS,
            1 << (PART + CONTEXT),
        )  # fmt: skip
        self._counts = np.zeros(shape, np.int32)
        self._tables: Tables | None = None

    def _place(self, registration: Registration, timing: Timing) -> None:
        self._registration, self.timing = registration, timing
        phase = float(timing.start(0, timing.rows / 2)) % 1
        self.delay = _MOVED if min(phase, 1 - phase) < EDGE else 0.0
        first = timing.first + self.delay
        self._time = first, timing.period, timing.slope, float(timing.rows)

    def moved(self, registration: Registration, timing: Timing) -> Self:
        """A detector that has learned the same, of an image that is shifted as a whole by less than
        a pixel, and of another timing."""
        other = copy(self)
        x, y = cell_centres(self._layout, registration)
        other.cells = replace(self.cells, x=x, y=y)
        other._place(registration, timing)
        other._counts = self._counts.copy()
        return other

    def shifts(self, first_symbol: int, count: int) -> Values:
        """Shift (dx, dy) of the image in the middle of each symbol, (count, 2)."""
        middle = self.timing.start(first_symbol + np.arange(count) + 0.5, self.timing.rows / 2)
        return self._registration.shifts(middle)

    def _learn(
        self, cells: CellImages, words: Words, start_tick: int, known: Bits, first_symbol: int,
        late: float = 0.0,
    ) -> None:  # fmt: skip
        """Counts patterns. `known` begins with the symbol before the first one."""
        order = np.argsort(cells.region, kind="stable")
        ends = np.searchsorted(cells.region[order], np.arange(cells.regions), side="right")
        place, (first, *rest) = cells.places, self._time
        by_rows(
            count_patterns, ends.size, words, start_tick, known, first_symbol,
            self.shifts(first_symbol, len(known) - 1),
            (first + late, *rest), self.ticks, order, ends, cells.x, cells.y, place.count,
            place.dx, place.dy, place.share, self._counts,
        )  # fmt: skip
        self._tables = None

    def tables(self) -> Tables:
        """Learned tables for `counting.add_evidence`."""
        if not self._counts.any():
            raise ValueError("the detector must have learned from known symbols before")
        if self._tables is None:
            self._tables = learned.tables(self._counts, self.ticks)
        return self._tables

    def learn(
        self, words: Words, start_tick: int, known: Bits, first_symbol: int, late: float = 0.0
    ) -> None:
        if known.ndim != 2 or known.shape[1] != self.cells.x.size:
            raise ValueError(f"known must be of {self.cells.x.size} cells, not {known.shape}")
        if first_symbol == 0:  # before first light all are off
            known = np.concatenate([np.zeros((1, known.shape[1]), np.bool_), known])
            first_symbol = -1
        self._learn(self.cells, words, start_tick, known, first_symbol + 1, late)

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        places = np.flatnonzero(self._layout.pilot)
        cells = cell_images(self._layout, self._registration, places, columns_alike=True)
        number = first_symbol + np.arange(-1, count)
        bits = pilots()[number % PERIOD] & (number >= 0)
        known = np.repeat(bits[:, None], len(places), axis=1)
        self._learn(cells, words, start_tick, known, first_symbol)
        if not self._counts.any():
            raise ValueError("the pilots of at least one whole symbol must be in the words")

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft:  # fmt: skip
        laws = self.tables()
        cells, place = self.cells, self.cells.places
        out = np.zeros((count, cells.x.size), np.float32)
        first, symbols = first_symbol - AROUND, count + 2 * AROUND
        by_rows(
            add_evidence, -(-cells.x.size // RUN), np.ascontiguousarray(words), start_tick,
            bits_held(words, start_tick, stop_tick), first, symbols, AROUND,
            self.shifts(first, symbols), self._time, self.ticks, cells.region, cells.reach,
            cells.x, cells.y, place.count, place.dx, place.dy, place.share, *laws,
            np.float32(LIMIT), out,
        )  # fmt: skip
        return out
