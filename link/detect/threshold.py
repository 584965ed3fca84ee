"""Hard decision from one spike: a plain receiver, the reference of the others.

Each cell has one pixel, the one with the largest share of its light, and each symbol one tick, the
one that it fills most. The bit is on if that pixel spikes in that tick.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words
from link.detect.counting import PHASES
from link.detect.detector import Bits, Soft, bits_held
from link.detect.geometry import PLACES, CellImages, cell_images
from link.layout import PERIOD, Layout, pilots
from link.timing import Registration, Timing


def _fullest(ticks: int) -> npt.NDArray[np.intp]:
    """Tick that a symbol fills most, counted from the one in which it begins, by phase class."""
    delay = (np.arange(PHASES) + 0.5) / PHASES
    return np.where(delay < 0.5, 0, 1) if ticks == 1 else np.ones(PHASES, np.intp)


class Threshold:
    """The threshold detector; see `Detector`.

    The magnitude of the soft values follows from the error rate over the whole panel; it is 1
    before anything is learned.
    """

    def __init__(
        self, layout: Layout, registration: Registration, timing: Timing, pixel: object = None
    ) -> None:
        self._layout, self._registration, self._timing = layout, registration, timing
        self._cells = cell_images(layout, registration)
        ticks = layout.mode.ticks
        self._fullest = _fullest(ticks)
        self._met = np.zeros((2, 2), np.int64)  # by bit and spike

    def _spikes(
        self,
        cells: CellImages,
        words: Words,
        start_tick: int,
        symbol: int,
        stop_tick: int | None = None,
    ) -> npt.NDArray[np.intp]:
        """0 or 1 for each cell; -1 if the words or the sensor do not contain it."""
        middle = float(self._timing.start(symbol + 0.5, self._timing.rows / 2))
        dx, dy = self._registration.shift(middle)
        u, v = cells.x + dx, cells.y + dy
        x, y = np.floor(u + 0.5).astype(np.intp), np.floor(v + 0.5).astype(np.intp)
        qx = np.minimum(((u - x + 0.5) * PLACES).astype(np.intp), PLACES - 1)
        qy = np.minimum(((v - y + 0.5) * PLACES).astype(np.intp), PLACES - 1)
        x += cells.places.dx[cells.region, qy, qx, 0]
        y += cells.places.dy[cells.region, qy, qx, 0]
        begin = self._timing.start(symbol, v)
        tick = np.floor(begin).astype(np.intp)
        phase = np.minimum(((begin - tick) * PHASES).astype(np.intp), PHASES - 1)
        bit = tick + self._fullest[phase] - start_tick
        _, height, width = words.shape
        stop = bits_held(words, start_tick, stop_tick)
        held = (bit >= 0) & (bit < stop) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        w, row, column = (np.where(held, i, 0) for i in (bit // WORD, y, x))
        spike = (words[w, row, column] >> (bit % WORD).astype(np.uint32)) & 1
        return np.where(held, spike.astype(np.intp), -1)

    def _learn(
        self, cells: CellImages, words: Words, start_tick: int, known: Bits, first_symbol: int
    ) -> None:
        for n, bits in enumerate(known):
            spike = self._spikes(cells, words, start_tick, first_symbol + n)
            there = spike >= 0
            np.add.at(self._met, (bits[there].astype(np.intp), spike[there]), 1)

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None:
        self._learn(self._cells, words, start_tick, known, first_symbol)

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        places = np.flatnonzero(self._layout.pilot)
        bits = pilots()[(first_symbol + np.arange(count)) % PERIOD]
        known = np.repeat(bits[:, None], len(places), axis=1)
        cells = cell_images(self._layout, self._registration, places)
        self._learn(cells, words, start_tick, known, first_symbol)

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft:  # fmt: skip
        right, wrong = self._met[0, 0] + self._met[1, 1], self._met[0, 1] + self._met[1, 0]
        size = 1.0 if not right + wrong else abs(np.log((right + 1) / (wrong + 1)))
        value = np.array([-size, size, 0.0], np.float32)  # index -1 is the last one
        out = np.empty((count, self._cells.x.size), np.float32)
        for n in range(count):
            spike = self._spikes(self._cells, words, start_tick, first_symbol + n, stop_tick)
            out[n] = value[spike]
        return out
