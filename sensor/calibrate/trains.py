"""A recording as spike trains of its pixels, and sums over their intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.run.progress import Progress
from cosim.spikes.viform import SpikeStream, words_for

LEAST_CYCLES: Final = 64
"""Shortest recording that is read, cycles; a pixel at 0.3 spikes a cycle then has 19 spikes."""
LEAST_ROWS: Final = 8
"""Fewest rows whose differences are measured."""
SIGNIFICANT: Final = 4.0
"""Standard errors from which what is measured is taken as real: one case in 16 000."""
_BYTES: Final = 1 << 30
"""Bytes of a stream that are read at most."""
WINDOW: Final = 8
"""Intervals of a window in which light is followed."""
_SHORTEST_MEAN: Final = 1.8
"""Least mean interval of a window, cycles: a shorter one may hide spikes."""
_LONGEST_MEAN: Final = 8
"""Largest mean interval of a window, cycles: noise and motion grow with it, rounding does not."""
Counts = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sums:
    """Successive sums of k intervals of pixels; a pixel without enough spikes is not used.

    Attributes:
        used: (n,) bool, pixels with `blocks` sums.
        k: intervals in a sum.
        blocks: sums of a pixel.
        variance: (n,) sample variance of the sums, cycles^2; 0 where not used.
        third: (n,) unbiased third central moment (k-statistic), cycles^3; 0 where not used.
    """

    used: npt.NDArray[np.bool_]
    k: int
    blocks: int
    variance: Values
    third: Values


@dataclass(frozen=True, eq=False)
class Changes:
    """Second and third differences of intervals, in windows of `WINDOW` successive intervals whose
    mean is from `_SHORTEST_MEAN` to `_LONGEST_MEAN` cycles.

    Attributes:
        number: (n, WINDOW) differences of each pixel, by what the cycles of their window leave over
            whole mean intervals; 0 where not used.
        second: (n,) sums of the squares of second differences, cycles^2.
        third: (n, WINDOW) the same of third ones, each as `number`.
        levels: windows whose mean is nearest to 0, 1, 2, ... cycles.
    """

    number: Counts
    second: Values
    third: Values
    levels: Counts


@dataclass(frozen=True, eq=False)
class Trains:
    """The spikes of a recording.

    Attributes:
        name: name of the file, for messages.
        shape: (height, width), pixels.
        cycles: number of cycles that were read.
        clock: clock of the latches.
        words: (n, words) uint32, pixel-major, n = height x width.
        spikes: (n,) spikes of each pixel.
        first, last: (n,) cycles of the first and the last spike; -1 for none.
    """

    name: str
    shape: tuple[int, int]
    cycles: int
    clock: Clock
    words: npt.NDArray[np.uint32]
    spikes: Counts
    first: Counts
    last: Counts

    @property
    def rate(self) -> float:
        """Spikes a cycle, mean of all pixels."""
        return float(self.spikes.mean() / self.cycles)

    @property
    def intervals(self) -> Values:
        """Mean interval of each pixel, cycles, (n,); infinite with fewer than two spikes."""
        out = np.full(self.spikes.shape, np.inf)
        np.divide(self.last - self.first, self.spikes - 1, out=out, where=self.spikes > 1)
        return out

    def sums(self, k: int, blocks: int, chosen: npt.NDArray[np.bool_]) -> Sums:
        """Moments of the first `blocks` sums of `k` intervals of the chosen pixels, (n,) bool."""
        used = chosen & (self.spikes > k * blocks)
        variance, third = np.zeros(used.shape), np.zeros(used.shape)
        _sums(self.words, self.cycles, k, blocks, used, variance, third)
        return Sums(used, k, blocks, variance, third)

    def successive(self, chosen: npt.NDArray[np.bool_]) -> tuple[Values, Values]:
        """Sum of the squared deviations of intervals from the mean of their pixel, and of the
        products of successive ones, (n,) each; 0 for other pixels."""
        squares, products = np.zeros(chosen.shape), np.zeros(chosen.shape)
        _successive(self.words, self.cycles, chosen & (self.spikes > 2), squares, products)
        return squares, products

    def changes(self, chosen: npt.NDArray[np.bool_]) -> Changes:
        """Second and third differences of successive intervals of the chosen pixels, (n,) bool."""
        n = len(chosen)
        number, levels = np.zeros((n, WINDOW), np.int64), np.zeros(_LONGEST_MEAN + 1, np.int64)
        second, third = np.zeros(n), np.zeros((n, WINDOW))
        used = chosen & (self.spikes > WINDOW)
        _changes(self.words, self.cycles, used, number, second, third, levels)
        return Changes(number, second, third, levels)

    def histogram(self, longest: int, chosen: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
        """Intervals of 1 to `longest` cycles, and longer ones, of the chosen pixels: (pixels,
        longest + 1)."""
        out = np.zeros((int(chosen.sum()), longest + 1), np.int32)
        _histogram(self.words[chosen], self.cycles, longest, out)
        return out

    def parts(self, number: int) -> Counts:
        """Spikes in each of `number` equal parts of the recording, (number, n); a part is whole
        words of 32 cycles, and what is left at the end is not counted."""
        size = self.cycles // 32 // number
        starts = range(0, number * size, size)
        return np.stack([
            np.bitwise_count(self.words[:, a : a + size]).sum(axis=1, dtype=np.int64)
            for a in starts
        ])  # fmt: skip


@njit(cache=True, nogil=True)
def _ends(words, cycles, spikes, first, last):  # type: ignore[no-untyped-def]
    """Number, first and last of the spikes of each pixel, written."""
    for pixel in range(words.shape[0]):
        for cycle in range(cycles):
            if (words[pixel, cycle >> 5] >> np.uint32(cycle & 31)) & np.uint32(1):
                if spikes[pixel] == 0:
                    first[pixel] = cycle
                last[pixel] = cycle
                spikes[pixel] += 1


@njit(cache=True, nogil=True)
def _sums(words, cycles, k, blocks, used, variance, third):  # type: ignore[no-untyped-def]
    """See `Sums`; variance and third are written."""
    sums = np.empty(blocks)
    for pixel in range(words.shape[0]):
        if not used[pixel]:
            continue
        n, done, begin = 0, 0, 0
        for cycle in range(cycles):
            if (words[pixel, cycle >> 5] >> np.uint32(cycle & 31)) & np.uint32(1):
                if n % k == 0:
                    if n > 0:
                        sums[done] = cycle - begin
                        done += 1
                        if done == blocks:
                            break
                    begin = cycle
                n += 1
        off = sums - sums.mean()
        variance[pixel] = (off * off).sum() / (blocks - 1)
        if blocks > 2:
            third[pixel] = (off * off * off).sum() * blocks / ((blocks - 1) * (blocks - 2))


@njit(cache=True, inline="always", nogil=True)
def _spikes(words, cycles, at):  # type: ignore[no-untyped-def]
    """Writes the cycles in which a pixel has spikes to `at`; returns their number."""
    n = 0
    for cycle in range(cycles):
        if (words[cycle >> 5] >> np.uint32(cycle & 31)) & np.uint32(1):
            at[n] = cycle
            n += 1
    return n


@njit(cache=True, nogil=True)
def _successive(words, cycles, used, squares, products):  # type: ignore[no-untyped-def]
    """See `Trains.successive`; squares and products are written."""
    at = np.empty(cycles, np.int64)
    for pixel in range(words.shape[0]):
        if not used[pixel]:
            continue
        n = _spikes(words[pixel], cycles, at)
        mean = (at[n - 1] - at[0]) / (n - 1)
        last = 0.0
        for i in range(n - 1):
            off = at[i + 1] - at[i] - mean
            squares[pixel] += off * off
            products[pixel] += off * last
            last = off


@njit(cache=True, nogil=True)
def _changes(words, cycles, used, number, second, third, levels):  # type: ignore[no-untyped-def]
    """See `Changes`, whose arrays are written."""
    at = np.empty(cycles, np.int64)
    for pixel in range(words.shape[0]):
        if not used[pixel]:
            continue
        n = _spikes(words[pixel], cycles, at)
        for begin in range(0, n - WINDOW, WINDOW):
            mean = (at[begin + WINDOW] - at[begin]) / WINDOW
            if mean < _SHORTEST_MEAN or mean > _LONGEST_MEAN:
                continue
            levels[int(mean + 0.5)] += 1
            over = (at[begin + WINDOW] - at[begin]) % WINDOW
            for i in range(begin, begin + WINDOW - 3):
                a, b = at[i + 1] - at[i], at[i + 2] - at[i + 1]
                c, d = at[i + 3] - at[i + 2], at[i + 4] - at[i + 3]
                second[pixel] += (d - 2 * c + b) ** 2
                third[pixel, over] += (d - 3 * c + 3 * b - a) ** 2
                number[pixel, over] += 1


@njit(cache=True, nogil=True)
def _histogram(words, cycles, longest, out):  # type: ignore[no-untyped-def]
    """See `Trains.histogram`; out is written."""
    for pixel in range(words.shape[0]):
        before = -1
        for cycle in range(cycles):
            if (words[pixel, cycle >> 5] >> np.uint32(cycle & 31)) & np.uint32(1):
                if before >= 0:
                    out[pixel, min(cycle - before, longest + 1) - 1] += 1
                before = cycle


class Steps:
    """Steps of a calibration, shown. progress: receives them, None for no one; total: how many."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._done = progress, 0
        if progress is not None:
            progress.start("calibrate", total)

    def __call__(self, what: str) -> None:
        """Begins a step; those before it are done."""
        if self._progress is not None:
            self._progress.tell(f"calibrate: {what}")
            self._progress.advance(self._done)
        self._done += 1


def read_trains(stream: SpikeStream, name: str, clock: Clock | None = None) -> Trains:
    """Reads a recording, its first GiB if it is longer.

    Args:
        stream: the recording.
        name: name of the file.
        clock: clock of the camera in place of the stream's, which a `.dat` does not hold.

    Raises:
        InputError: fewer than `LEAST_CYCLES` cycles.
    """
    height, width = stream.shape
    cycles = min(stream.cycles, max(_BYTES // (4 * height * width), 2) * 32)
    if cycles < LEAST_CYCLES:
        raise InputError(name, f"of {LEAST_CYCLES} cycles or more", f"{cycles}", "record longer")
    read = stream.read_words(0, words_for(cycles))
    words = np.ascontiguousarray(read.reshape(len(read), -1).T)
    counts: list[Any] = [np.zeros(len(words), np.int64)]
    counts += [np.full(len(words), -1, np.int64) for _ in range(2)]
    _ends(words, cycles, *counts)
    return Trains(name, (height, width), cycles, clock or stream.clock, words, *counts)
