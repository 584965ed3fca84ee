"""Event form of a viform: (i, j, t, tau), for sparse, coded and asynchronous streams.

Huang 2022 section 5.2: a spike has the position of its pixel, the instant at which it fires, and
its width, the time in which its charge accumulated. Both times are integer ticks of a clock: the
latch clock of a synchronous chip, or the much faster clock of an asynchronous one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.spikes.viform import WORD, SpikeStream, Words, unpack_planes, words_for

_PIXELS = 2**20
"""Pixel-cycles that `event_blocks` converts at a time."""
Ticks = npt.NDArray[np.int64]
Places = npt.NDArray[np.uint16]
COLUMNS: dict[str, type[np.generic]] = {
    "row": np.uint16,
    "column": np.uint16,
    "time": np.int64,
    "width": np.int64,
    "level": np.uint16,
}
"""Arrays of events and their types; `level` may be absent."""


@dataclass(frozen=True, eq=False, repr=False)
class Events:
    """Spikes in the order of time; those of one tick in the order of transmission.

    Attributes:
        row, column: (n,) uint16, position of the pixel.
        time: (n,) int64, tick in which the spike was latched, counted from tick 0 of `clock`.
        width: (n,) int64 > 0, ticks; that of a pixel's first spike counts from `start`.
        shape: (H, W) of the plane.
        ticks: number of ticks; the stream covers start .. start + ticks - 1.
        clock: clock of the ticks.
        start: first tick.
        level: (n,) uint16, quantised share of the threshold at the longest width, in units of 1 /
            `levels`; `levels` is a full spike. None if all spikes are full.
        levels: number of levels.

    Raises:
        ValueError: an array has another type or length, or an event is outside shape or time.
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

    def __repr__(self) -> str:
        height, width = self.shape
        return (
            f"{len(self)} events of {width} x {height} pixels in {self.ticks / self.clock.hz:g} s, "
            f"in ticks of {1e9 / self.clock.hz:g} ns"
        )

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


def time_order(time: Ticks, pixel: npt.NDArray[Any]) -> Ticks:
    """Indices that order events by their time, and those of one time by the number of the pixel,
    (n,); pixel: 0 or more. No pixel has two at a time."""
    if time.size < 2:
        return np.arange(time.size)
    begin, bits = int(time.min()), int(pixel.max()).bit_length()
    if (int(time.max()) - begin).bit_length() + bits > 64:
        return np.lexsort((pixel, time))
    # One key, which no two share, is sorted by vectors: in a quarter of the time of lexsort.
    key = (time - begin).astype(np.uint64)
    key <<= np.uint64(bits)
    key |= pixel.astype(np.uint64)
    if (key[1:] > key[:-1]).all():
        return np.arange(time.size)
    return np.argsort(key)


def event_blocks(stream: SpikeStream) -> Iterator[tuple[Places, Places, Ticks, Ticks]]:
    """Yields row, column, time and width of the spikes of a synchronous stream, a few cycles at a
    time. The width is the interval. Spikes of one cycle are in row-major order."""
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


def mark_planes(words: Words, row: Places, column: Places, cycle: Ticks) -> None:
    """Sets spikes in contiguous (n, H, W) words. cycle: counted from the first one in words[0]."""
    word, bit = np.divmod(cycle, WORD)
    place = (word * words.shape[1] + row) * words.shape[2] + column
    np.bitwise_or.at(words.reshape(-1), place, np.uint32(1) << bit.astype(np.uint32))


def only_full(events: Events) -> tuple[Events, int]:
    """The events that are full spikes, and the number of the others."""
    if events.level is None:
        return events, 0
    full = events.level == events.levels
    kept = Events(
        events.row[full], events.column[full], events.time[full], events.width[full], events.shape,
        events.ticks, events.clock, events.start,
    )  # fmt: skip
    return kept, int((~full).sum())
