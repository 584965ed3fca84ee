"""Event form of a viform: (i, j, t, tau), for sparse, coded and asynchronous streams.

Huang 2022 section 5.2: a spike is the place of its pixel, the instant it fires, and its width, the
time its charge took to gather. Both times are whole ticks of the clock they are measured with: the
latch clock of a synchronous chip, a much faster one of an asynchronous.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.spikes.viform import WORD, SpikeStream, Viform, Words, unpack_planes, words_for

__all__ = ["COLUMNS", "Events", "event_blocks", "events_of", "mark_planes", "viform_of"]

_PIXELS = 2**20
"""Pixel-cycles whose spikes `event_blocks` makes at a time."""
Ticks = npt.NDArray[np.int64]
Places = npt.NDArray[np.uint16]
COLUMNS: dict[str, type[np.generic]] = {
    "row": np.uint16,
    "column": np.uint16,
    "time": np.int64,
    "width": np.int64,
    "level": np.uint16,
}
"""An event's arrays and their types; `level` may be absent."""


@dataclass(frozen=True, eq=False)
class Events:
    """Spikes in the order of their time; those of one tick in the order they were sent.

    row, column: (n,) uint16. time: (n,) int64, the tick in which the spike was latched, counted
    from tick 0 of `clock`. width: (n,) int64 ticks > 0; a pixel's first spike has its width from
    `start` on. level: (n,) uint16 or None; the quantised share of the threshold that had gathered
    when the longest width was up, out of `levels`; `levels` itself is a full spike. shape: (H, W).
    ticks: the stream covers start .. start + ticks - 1.

    Raises ValueError for arrays of other types or lengths, and for events outside shape or time.
    """

    row: Places
    column: Places
    time: Ticks
    width: Ticks
    shape: tuple[int, int]
    ticks: int
    clock: Clock
    start: int = 0
    level: npt.NDArray[np.uint16] | None = None
    levels: int = 1

    def __post_init__(self) -> None:
        for name, dtype in COLUMNS.items():
            array = getattr(self, name)
            if array is not None and (array.shape != (len(self),) or array.dtype != dtype):
                raise ValueError(
                    f"{name} must be ({len(self)},) {np.dtype(dtype)}, "
                    f"not {array.shape} {array.dtype}"
                )
        if self.ticks < 1 or not 1 <= self.levels < 2**16:
            raise ValueError(f"ticks and levels must be 1 or more, not {self.ticks}, {self.levels}")
        if not len(self):
            return
        if self.row.max() >= self.shape[0] or self.column.max() >= self.shape[1]:
            raise ValueError(
                f"events must lie within {self.shape[0]} rows, {self.shape[1]} columns"
            )
        last = self.start + self.ticks - 1
        if self.time[0] < self.start or self.time[-1] > last or (np.diff(self.time) < 0).any():
            raise ValueError(f"times must rise from {self.start} to {last} or less")
        if self.width.min() < 1:
            raise ValueError("widths must be 1 tick or more")
        if self.level is not None and self.level.max() > self.levels:
            raise ValueError(f"levels must be {self.levels} or less")

    def __len__(self) -> int:
        return len(self.time)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Events):
            return NotImplemented
        named = ("shape", "ticks", "clock", "start", "levels")
        if any(getattr(self, n) != getattr(other, n) for n in named):
            return False
        if (self.level is None) != (other.level is None):
            return False
        arrays = ["row", "column", "time", "width"] + (["level"] if self.level is not None else [])
        return all(np.array_equal(getattr(self, n), getattr(other, n)) for n in arrays)

    __hash__ = None  # type: ignore[assignment]  # compares by content, which is mutable


def event_blocks(stream: SpikeStream) -> Iterator[tuple[Places, Places, Ticks, Ticks]]:
    """Row, column, time and width of every spike of a synchronous stream, a few cycles at a time;
    the width is the interval. Those of one cycle come from the top row down, from left to right."""
    height, columns = stream.shape
    start = int(getattr(stream, "start", 0))
    last = np.full(height * columns, start - 1, np.int64)
    step = min(max(_PIXELS // last.size, 1), WORD)
    for w in range(words_for(stream.cycles)):
        n = min(WORD, stream.cycles - w * WORD)
        planes = unpack_planes(stream.read_words(w, w + 1), 0, n).view(np.bool_).reshape(n, -1)
        for first in range(0, n, step):
            pixels = [np.flatnonzero(plane) for plane in planes[first : first + step]]
            cycles = start + w * WORD + first + np.arange(len(pixels), dtype=np.int64)
            widths = []
            for cycle, pixel in zip(cycles, pixels, strict=True):
                widths.append(cycle - last[pixel])
                last[pixel] = cycle
            row, column = np.divmod(np.concatenate(pixels), columns)
            time = np.repeat(cycles, [len(pixel) for pixel in pixels])
            yield row.astype(np.uint16), column.astype(np.uint16), time, np.concatenate(widths)


def events_of(stream: SpikeStream) -> Events:
    """Every spike of a synchronous stream, with its interval as width; those of one cycle from the
    top row down, from left to right."""
    row, column, time, width = (
        np.concatenate(parts) for parts in zip(*event_blocks(stream), strict=True)
    )
    start = int(getattr(stream, "start", 0))
    return Events(row, column, time, width, stream.shape, stream.cycles, stream.clock, start)


def mark_planes(words: Words, row: Places, column: Places, cycle: Ticks) -> None:
    """Sets these spikes in contiguous (n, H, W) words. cycle: counted from words[0]."""
    word, bit = np.divmod(cycle, WORD)
    place = (word * words.shape[1] + row) * words.shape[2] + column
    np.bitwise_or.at(words.reshape(-1), place, np.uint32(1) << bit.astype(np.uint32))


def viform_of(events: Events) -> Viform:
    """The planes of events that fit them: full spikes only, at most one a pixel and tick.

    Raises ValueError for others.
    """
    full = events.level is None or bool((events.level == events.levels).all())
    words: Words = np.zeros((words_for(events.ticks), *events.shape), np.uint32)
    mark_planes(words, events.row, events.column, events.time - events.start)
    if not full or int(np.bitwise_count(words).sum(dtype=np.int64)) != len(events):
        raise ValueError("planes hold full spikes alone, at most one a pixel and tick")
    return Viform(words, events.ticks, events.clock, events.start)
