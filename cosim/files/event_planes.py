"""Spike planes from an event file with at most one full spike a pixel and tick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.compute.memory import check_memory
from cosim.errors import InputError
from cosim.files.event_file import ENDING, EventFile, Part
from cosim.spikes.events import mark_planes
from cosim.spikes.viform import Words, words_for

__all__ = ["EventStream"]


class _Intervals:
    """Counts events whose width differs from the interval to the pixel's previous spike."""

    def __init__(self, file: EventFile) -> None:
        self._columns, self.other = file.shape[1], 0
        self._last = np.full(file.shape[0] * file.shape[1], file.start - 1, np.int64)

    def add(self, part: Part) -> None:
        """Counts those of a part; parts come in order."""
        pixel = part["row"].astype(np.int64) * self._columns + part["column"]
        order = np.argsort(pixel, kind="stable")
        pixel, time = pixel[order], part["time"][order]
        opens: npt.NDArray[np.bool_] = np.diff(pixel, prepend=-1) != 0
        before = np.where(opens, self._last[pixel], np.roll(time, 1))
        self.other += int((time - before != part["width"][order]).sum())
        closes = np.roll(opens, -1)
        self._last[pixel[closes]] = time[closes]


class EventStream:
    """An event file as a spike stream.

    Its planes are computed in memory on first use, from parts of the events. Raises InputError for
    another file, and when the planes are computed: for damage, for events that planes cannot hold,
    and if memory is short.

    Attributes:
        notes: properties of the events that planes do not hold; known after the first use.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.file = EventFile(path)
        self.shape, self.cycles = self.file.shape, self.file.ticks
        self.clock, self.start = self.file.clock, self.file.start
        self.notes: tuple[str, ...] = ()
        self._words: Words | None = None

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), as a view; see `SpikeStream`."""
        if self._words is None:
            self._words = self._compute()
        return self._words[first:stop]

    def _compute(self) -> Words:
        """Words of all events."""
        file, (height, width) = self.file, self.shape
        n = words_for(self.cycles)
        remedy = "keep its events, or cut them into shorter files"
        check_memory(f"the planes of {self._path}", (4 * n + 8) * height * width, remedy)
        words: Words = np.zeros((n, height, width), np.uint32)
        intervals, full = _Intervals(file), True
        for part in file.parts():
            mark_planes(words, part["row"], part["column"], part["time"] - file.start)
            full = full and bool((part.get("level", np.uint16(file.levels)) == file.levels).all())
            intervals.add(part)
        set_bits = sum(int(np.bitwise_count(w).sum(dtype=np.int64)) for w in words)
        if not full or set_bits != file.count:
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
        return words
