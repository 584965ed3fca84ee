"""Spike planes from an event file with at most one full spike a pixel and tick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.compute.memory import check_memory
from cosim.errors import InputError
from cosim.files.event_file import ENDING, EventFile, Part
from cosim.spikes.events import mark_planes
from cosim.spikes.viform import WORD, Words, words_for

_WORD_BYTES = 20
"""Memory of a word that is not 0, in the sparse form. An event has at most one."""
_BYTES = 64
"""Memory for each event in the sparse form, with the arrays in use."""
_COUNTED = 2**22
"""Words whose bits are counted at once."""


class _Intervals:
    """Counts events whose width differs from the interval to the pixel's previous spike."""

    def __init__(self, file: EventFile) -> None:
        self._columns, self._start, self.other = file.shape[1], file.start, 0
        self._pixel = np.empty(0, np.int64)
        self._time = np.empty(0, np.int64)
        """The pixels that have fired, in order, and the time of the last spike of each."""

    def add(self, part: Part) -> None:
        """Counts those of a part; parts come in order."""
        pixel = part["row"].astype(np.int64) * self._columns + part["column"]
        order = np.argsort(pixel, kind="stable")
        pixel, time = pixel[order], part["time"][order]
        opens: npt.NDArray[np.bool_] = np.diff(pixel, prepend=-1) != 0
        before = np.where(opens, self._last(pixel), np.roll(time, 1))
        self.other += int((time - before != part["width"][order]).sum())
        closes = np.roll(opens, -1)
        pixels = np.concatenate([pixel[closes], self._pixel])
        times = np.concatenate([time[closes], self._time])
        self._pixel, newest = np.unique(pixels, return_index=True)  # the first of equals
        self._time = times[newest]

    def _last(self, pixel: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Time of the last spike of pixels before this part; before the start if there was none."""
        if not self._pixel.size:
            return np.full(pixel.size, self._start - 1)
        place = np.minimum(np.searchsorted(self._pixel, pixel), self._pixel.size - 1)
        known = self._pixel[place] == pixel
        return np.where(known, self._time[place], self._start - 1)


class _Dense:
    """All words of planes.

    Attributes:
        count: number of set bits; known after `finish`.
    """

    def __init__(self, words: int, shape: tuple[int, int]) -> None:
        self._words: Words = np.zeros((words, *shape), np.uint32)
        self.count = 0

    def add(self, cycle: npt.NDArray[np.int64], part: Part) -> None:
        """Adds the spikes of a part. cycle: counted from the first one."""
        mark_planes(self._words, part["row"], part["column"], cycle)

    def finish(self) -> None:
        """Ends the parts."""
        flat = self._words.reshape(-1)
        for at in range(0, flat.size, _COUNTED):
            self.count += int(np.bitwise_count(flat[at : at + _COUNTED]).sum(dtype=np.int64))

    def read(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), a view."""
        return self._words[first:stop]


class _Sparse:
    """The words of planes that are not 0, in their order.

    Memory depends on the number of events, and not on the size and length that a file states. The
    interface is that of `_Dense`.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._left: Part | None = None
        self._word: list[npt.NDArray[np.int64]] = []
        self._pixel: list[npt.NDArray[np.int64]] = []
        self._bits: list[npt.NDArray[np.uint32]] = []
        self.count = 0

    def add(self, cycle: npt.NDArray[np.int64], part: Part) -> None:
        pixel = part["row"].astype(np.int64) * self._shape[1] + part["column"]
        if self._left is not None:
            cycle = np.concatenate([self._left["cycle"], cycle])
            pixel = np.concatenate([self._left["pixel"], pixel])
        word = cycle // WORD
        done = int(np.searchsorted(word, word[-1])) if word.size else 0  # the last may go on
        self._left = {"cycle": cycle[done:], "pixel": pixel[done:]}
        self._store(cycle[:done], pixel[:done])

    def _store(self, cycle: npt.NDArray[np.int64], pixel: npt.NDArray[np.int64]) -> None:
        if not cycle.size:
            return
        word, bit = np.divmod(cycle, WORD)
        order = np.lexsort((pixel, word))
        word, pixel, bit = word[order], pixel[order], bit[order]
        new = (np.diff(word, prepend=-1) != 0) | (np.diff(pixel, prepend=-1) != 0)
        first = np.flatnonzero(new)
        bits = np.bitwise_or.reduceat(np.uint32(1) << bit.astype(np.uint32), first)
        self.count += int(np.bitwise_count(bits).sum(dtype=np.int64))
        self._word.append(word[first])
        self._pixel.append(pixel[first])
        self._bits.append(bits)

    def finish(self) -> None:
        if self._left is not None:
            self._store(self._left["cycle"], self._left["pixel"])
        none = np.empty(0, np.int64)
        self.word = np.concatenate([none, *self._word])
        self.pixel = np.concatenate([none, *self._pixel])
        self.bits = np.concatenate([none.astype(np.uint32), *self._bits])
        self._left, self._word, self._pixel, self._bits = None, [], [], []

    def read(self, first: int, stop: int) -> Words:
        words: Words = np.zeros((stop - first, self._shape[0] * self._shape[1]), np.uint32)
        a, b = np.searchsorted(self.word, [first, stop])
        words[self.word[a:b] - first, self.pixel[a:b]] = self.bits[a:b]
        return words.reshape(-1, *self._shape)


class EventStream:
    """An event file as a spike stream.

    Its words are computed in memory on first use, from parts of the events; if most are 0, only the
    others. Raises InputError for another file, and when the words are computed: for damage, for
    events that planes cannot hold, and if memory is short.

    Attributes:
        notes: properties of the events that planes do not hold; known after the first use.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.file = EventFile(path)
        self.shape, self.cycles = self.file.shape, self.file.ticks
        self.clock, self.start = self.file.clock, self.file.start
        self.notes: tuple[str, ...] = ()
        self._planes: _Dense | _Sparse | None = None

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), possibly a view; see `SpikeStream`."""
        if self._planes is None:
            self._planes = self._compute()
        first, stop, _ = slice(first, stop).indices(words_for(self.cycles))
        stop = max(first, stop)
        return self._planes.read(first, stop)

    def _check_memory(self, need: int) -> None:
        remedy = "keep its events, or cut them into shorter files"
        check_memory(f"the planes of {self._path}", need, remedy)

    def _compute(self) -> _Dense | _Sparse:
        """The words of all events, in the smaller of the two forms."""
        file, n = self.file, words_for(self.cycles)
        dense = 4 * n * self.shape[0] * self.shape[1]
        sparse = dense > _WORD_BYTES * file.count
        # A reader goes through all planes, so they are limited to the memory in either form.
        self._check_memory(max(dense, _BYTES * file.count) if sparse else dense)
        planes = _Sparse(self.shape) if sparse else _Dense(n, self.shape)
        intervals, full = _Intervals(file), True
        for part in file.parts():
            planes.add(part["time"] - file.start, part)
            full = full and bool((part.get("level", np.uint16(file.levels)) == file.levels).all())
            intervals.add(part)
        planes.finish()
        if not full or planes.count != file.count:
            raise InputError(
                f"{self._path}",
                "full spikes alone, at most one a pixel and tick, to be held in planes",
                "others",
                f"keep it as events: viform convert {self._path} OUT{ENDING}",
            )
        if intervals.other:
            self.notes = (
                f"{intervals.other} of {file.count} events of {self._path} have a width that is "
                "not the interval between spikes, which is all that planes keep",
            )
        return planes
