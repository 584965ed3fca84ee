"""Soft joint decision over the pixels of a cell and the ticks of a symbol.

Given a bit, the pixels of a cell are taken to spike independently of each other, so the log
likelihood ratios of all its pixels and ticks add up. Each is that of the pixel's class, learned
from symbols that are known; nothing of the sensor or of the light is given.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.viform import Words
from link.detect.counting import CONTEXT, PART, PHASES, add_evidence, count_patterns
from link.detect.detector import Bits, Soft
from link.detect.geometry import SHARES, Seen, see
from link.detect.tables import parts_for, tables
from link.layout import PERIOD, Layout, pilots
from link.timing import Registration, Timing

__all__ = ["LIMIT", "Joint"]

LIMIT: Final = 60.0
"""Of a soft value's size."""

Values = npt.NDArray[np.float64]


class Joint:
    """See `Detector`."""

    def __init__(self, layout: Layout, registration: Registration, timing: Timing) -> None:
        self._layout, self._registration, self._timing = layout, registration, timing
        self._seen = see(layout, registration)
        self._reads = layout.mode.ticks + 1
        self._time = timing.first, timing.period, timing.slope, float(timing.rows)
        shape = (
            self._seen.regions, PHASES, parts_for(self._reads), SHARES, 2, 1 << (PART + CONTEXT),
        )  # fmt: skip
        self._counts = np.zeros(shape, np.int32)
        self._tables: tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None = None

    def _shifts(self, first_symbol: int, count: int) -> Values:
        """(dx, dy) of the image in the middle of each symbol, (count, 2)."""
        middle = self._timing.start(first_symbol + np.arange(count) + 0.5, self._timing.rows / 2)
        return np.array([self._registration.shift(float(t)) for t in middle]).reshape(count, 2)

    def _learn(
        self, seen: Seen, words: Words, start_tick: int, known: Bits, first_symbol: int
    ) -> None:
        if known.shape[1] != seen.x.size:
            raise ValueError(f"known must be of {seen.x.size} cells, not {known.shape[1]}")
        order = np.argsort(seen.region, kind="stable")
        ends = np.searchsorted(seen.region[order], np.arange(seen.regions), side="right")
        place = seen.places
        count_patterns(
            words, start_tick, known, first_symbol, self._shifts(first_symbol, len(known)),
            self._time, self._reads, order, ends, seen.x, seen.y, place.count, place.dx, place.dy,
            place.share, self._counts,
        )  # fmt: skip
        self._tables = None

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None:
        self._learn(self._seen, words, start_tick, known, first_symbol)

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        cells = np.flatnonzero(self._layout.pilot)
        seen = see(self._layout, self._registration, cells, columns_alike=True)
        bits = pilots()[(first_symbol + np.arange(count)) % PERIOD]
        known = np.repeat(bits[:, None], len(cells), axis=1)
        self._learn(seen, words, start_tick, known, first_symbol)

    def soft(self, words: Words, start_tick: int, first_symbol: int, count: int) -> Soft:
        if not self._counts.any():
            raise ValueError("the detector must have learned from known symbols before")
        if self._tables is None:
            self._tables = tables(self._counts, self._layout.mode.ticks, self._reads)
        seen, place = self._seen, self._seen.places
        out = np.empty((count, seen.x.size), np.float32)
        add_evidence(
            words, start_tick, first_symbol, self._shifts(first_symbol, count), self._time,
            self._reads, seen.region, seen.x, seen.y, place.count, place.dx, place.dy, place.share,
            *self._tables, np.float32(LIMIT), out,
        )  # fmt: skip
        return out
