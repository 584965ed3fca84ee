"""`.events.npz`: the event form of a stream as one numpy archive.

`row`, `column` (n,) uint16, `time`, `width` (n,) int64 ticks; where spikes are quantised, `level`
(n,) uint16 and `levels`; `shape` (height, width), `ticks`, `clock` (numerator and denominator in
Hz) and `start`. `cosim/spikes/events.py` defines them and their order.

A megapixel stream may have 1e9 spikes of 20 bytes each, so files are read and written in parts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.archive import ArchiveWriter, ArrayReader, open_arrays
from cosim.clock import Clock
from cosim.compute.memory import check_memory
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.spikes.events import COLUMNS, Events, event_blocks
from cosim.spikes.viform import SpikeStream, count_spikes

ENDING = ".events.npz"
PART = 2**20
"""Events of a part."""
LEVEL = 1
"""Compression level of zlib. The sorted positions and times compress well at any level."""
_LARGEST = 2**16
"""Upper limit of rows and of columns."""
_LATEST = 2**62
"""Upper limit of ticks, so that sums fit in 64 bits."""
_SMALL = {"shape": 2, "ticks": 1, "clock": 2, "start": 1, "levels": 1}
"""Number of elements of the other arrays."""
_OPTIONAL = {"level", "levels"}

Part = dict[str, npt.NDArray[Any]]
"""A part of the events: arrays of `COLUMNS` by name, of equal length."""


@dataclass
class EventSource(ABC):
    """Events that can be read repeatedly, part by part.

    Attributes:
        shape, ticks, clock, start, levels: see `Events`.
        has_level: whether events have a level.
        count: number of events.
    """

    shape: tuple[int, int]
    ticks: int
    clock: Clock
    start: int
    levels: int
    has_level: bool
    count: int

    @abstractmethod
    def parts(self) -> Iterator[Part]:
        """The events in parts, in their order."""


class _InMemory(EventSource):
    def __init__(self, events: Events) -> None:
        super().__init__(
            events.shape, events.ticks, events.clock, events.start, events.levels,
            events.level is not None, len(events),
        )  # fmt: skip
        self._events = events

    def parts(self) -> Iterator[Part]:
        yield {name: getattr(self._events, name) for name in COLUMNS}


class _OfStream(EventSource):
    """All spikes of a synchronous stream, computed again in each pass."""

    def __init__(self, stream: SpikeStream) -> None:
        count = int(count_spikes(stream, 0, stream.cycles).sum(dtype=np.int64))
        start = int(getattr(stream, "start", 0))
        super().__init__(stream.shape, stream.cycles, stream.clock, start, 1, False, count)
        self._stream = stream

    def parts(self) -> Iterator[Part]:
        for arrays in event_blocks(self._stream):
            yield dict(zip(COLUMNS, arrays, strict=False))  # a spike has no level


class EventFile(EventSource):
    """An `.events.npz`, which is checked while it is read. Raises InputError for any other file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with open_arrays(path) as arrays:
                super().__init__(*self._header(arrays))
            _events({name: np.empty(0, dtype) for name, dtype in COLUMNS.items()}, self)
        except KeyError as exc:
            raise self._bad(f"one without {exc}") from exc
        except (ValueError, TypeError) as exc:
            raise self._bad(f"one where {exc}") from exc

    def _bad(self, value: str) -> InputError:
        return InputError(
            f"{self._path}",
            "events: row, column, time, width, shape, ticks, clock and start",
            value,
            "write it with viform convert",
        )

    @staticmethod
    def _header(
        arrays: dict[str, ArrayReader],
    ) -> tuple[tuple[int, int], int, Clock, int, int, bool, int]:
        unknown = arrays.keys() - COLUMNS.keys() - _SMALL.keys()
        if unknown:
            raise ValueError(f"{min(unknown)!a} is no array of this format")
        numbers: dict[str, list[int]] = {}
        for name, count in _SMALL.items():
            if name in _OPTIONAL and name not in arrays:
                continue
            reader = arrays[name]
            if reader.shape not in ((count,), ()) or (count > 1 and not reader.shape):
                raise ValueError(f"{name} is of shape {reader.shape}")
            numbers[name] = [index(n) for n in reader.read(count)]
        count = arrays["time"].shape[0] if len(arrays["time"].shape) == 1 else -1
        for name, dtype in COLUMNS.items():
            if name in _OPTIONAL and name not in arrays:
                continue
            if arrays[name].shape != (count,) or arrays[name].dtype != dtype:
                value = f"{arrays[name].shape} {arrays[name].dtype}"
                raise ValueError(f"{name} is {value}, not ({count},) {np.dtype(dtype)}")
        height, width = numbers["shape"]
        if not (1 <= height <= _LARGEST and 1 <= width <= _LARGEST):
            raise ValueError(f"shape is {height} rows, {width} columns")
        levels = numbers.get("levels", [1])[0]
        head = (numbers["ticks"][0], Clock(*numbers["clock"]), numbers["start"][0], levels)
        if max(abs(head[0]), abs(head[2])) > _LATEST:
            raise ValueError(f"ticks and start are {head[0]}, {head[2]}")
        return (height, width), *head, "level" in arrays, count

    def parts(self) -> Iterator[Part]:
        """The events in parts. Raises InputError if they are damaged, out of order or out of
        range."""
        names = [name for name in COLUMNS if name != "level" or self.has_level]
        last = None
        try:
            with open_arrays(self._path) as arrays:
                for first in range(0, max(self.count, 1), PART):
                    count = min(PART, self.count - first)
                    part = {name: arrays[name].read(count) for name in names}
                    events = _events(part, self)
                    if count and last is not None and events.time[0] < last:
                        raise ValueError("times must rise")
                    last = events.time[-1] if count else last
                    yield part
        except (ValueError, KeyError) as exc:
            raise self._bad(f"one where {exc}") from exc


def _events(part: Part, header: EventSource) -> Events:
    """A part as events, which are checked. Raises ValueError."""
    return Events(
        part["row"], part["column"], part["time"], part["width"], header.shape, header.ticks,
        header.clock, header.start, part.get("level"), header.levels,
    )  # fmt: skip


def read_events(path: Path) -> Events:
    """All events of a file in memory. Raises InputError for another file, or if memory is short."""
    file = EventFile(path)
    each = sum(np.dtype(dtype).itemsize for dtype in COLUMNS.values())
    check_memory(f"the {file.count} events of {path}", 2 * each * file.count, "use its planes")
    parts = list(file.parts())
    joined: Part = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return _events(joined, file)


def write_events(source: SpikeStream | Events | EventFile, path: Path) -> None:
    """Writes events, or all spikes of a stream, as `.events.npz` without loss.

    The source is read once for each array, so that only a part is in memory.
    """
    if isinstance(source, EventFile):
        events: EventSource = source
    else:
        events = _InMemory(source) if isinstance(source, Events) else _OfStream(source)
    height, width = events.shape
    if max(height, width) > _LARGEST:
        raise InputError(
            "the size of an event stream", f"at most {_LARGEST}x{_LARGEST}", f"{width}x{height}",
            "use .npz or .zarr",
        )  # fmt: skip
    with atomic_write(path) as part, part.open("wb") as file, ArchiveWriter(file, LEVEL) as archive:
        archive.write("shape", np.array(events.shape, np.int64))
        archive.write("ticks", np.int64(events.ticks))
        archive.write("clock", np.array([events.clock.num, events.clock.den], np.int64))
        archive.write("start", np.int64(events.start))
        if events.has_level or events.levels != 1:
            archive.write("levels", np.int64(events.levels))
        for name, dtype in COLUMNS.items():
            if name != "level" or events.has_level:
                columns = (values[name] for values in events.parts())
                archive.write_parts(name, dtype, (events.count,), columns)
