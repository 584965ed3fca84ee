"""Random programs: register writes at random clocks, with all corner cases of the sensor's map.

A program depends on size and seed only. Chunk n is drawn from (seed, n), so that runs of any length
are reproducible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS

ADDRESS = {entry.name: entry.address for entry in REGISTERS} | {
    memory.name: memory.address for memory in MEMORIES
}
"""Byte address of every register and memory."""

_NOWHERE = (0x0000_0028, 0x0000_0128, 0x0000_05F0, 0x0010_0000 - 4, 0x7FFF_FFFC)
_CLOCK_HZ = 4_000_000  # 100 clocks in a nominal tick, so that the shortest tick decides

_LENGTH = 9  # binary logarithm of the longest chunk, in ticks


class Write(NamedTuple):
    """A bus write.

    Attributes:
        clock: clock of the write's strobe.
        address: bytes.
        value: 32 bits.
    """

    clock: int
    address: int
    value: int


class Chunk(NamedTuple):
    """A part of a program: timed writes, then accesses without a fixed clock.

    Attributes:
        stop: clock after the timed writes.
        writes: timed writes.
        reads: byte addresses to read; after that of `write_mem`, a numbered write follows. The
            capture registers are compared only if no burst is in progress.
        pointer: value written to the capture's pointer.
        drain: words of the capture memory that are read.
    """

    stop: int
    writes: list[Write]
    reads: list[int]
    pointer: int
    drain: int


@dataclass(frozen=True)
class Program:
    """A program, determined by size and seed.

    Attributes:
        rows, columns: pixels of the board.
        lanes: pixels of a tile, 32 or 64.
        seed: 0 to 2^32 - 1.
    """

    rows: int = 32
    columns: int = 32
    lanes: int = 32
    seed: int = 0

    @cached_property
    def geometry(self) -> Geometry:
        """The build, with memories small enough to overflow."""
        words = 4 * (self.rows * (self.columns // 32 + 4))
        capture = 1 << max(6, min(12, words.bit_length()))
        return Geometry(
            self.rows,
            self.columns,
            self.lanes,
            clock_hz=_CLOCK_HZ,
            capture_words=capture,
            sink_words=64,
        )

    def chunk(self, number: int, clock: int) -> Chunk:
        """Chunk `number`, which begins at `clock`."""
        return _Draw(self.geometry, np.random.default_rng((self.seed, number)), number, clock).chunk


class _Draw:
    """Draws one chunk. A move is one action of a user, which takes one or several writes."""

    def __init__(
        self, geometry: Geometry, rng: np.random.Generator, number: int, clock: int
    ) -> None:
        self.size, self.rng, self._first = geometry, rng, clock
        self._due: dict[int, tuple[int, int]] = {}  # clock: address, value
        if number == 0:
            for word in range(geometry.pattern_bytes // 4):
                self._put(clock, ADDRESS["pattern_mem"] + 4 * word, self._word())
            self._set(clock, "sensor_tick_clocks", 0)
            self._set(clock, "sensor_run", 1)
        length = int(geometry.tick_minimum * 2 ** rng.uniform(0, _LENGTH))
        stop = clock + length
        moves = self._moves()
        chances = np.array([chance for chance, _ in moves], float)
        picks = rng.choice(len(moves), int(rng.integers(0, 40)), p=chances / chances.sum())
        for pick in picks:
            moves[pick][1](clock + int(rng.integers(length)))
        last = max(self._due, default=0)
        writes = [Write(when, *what) for when, what in sorted(self._due.items())]
        pattern = ADDRESS["pattern_mem"] + 4 * rng.integers(geometry.pattern_bytes // 4, size=4)
        readable = [entry.address for entry in REGISTERS if entry.name != "capture_data"]
        rng.shuffle(readable)
        identifier = ADDRESS["identifier_mem"] + 4 * int(rng.integers(40))
        reads = [*readable, *map(int, pattern), identifier, int(rng.choice(_NOWHERE))]
        reads.append(ADDRESS["write_mem"])
        end = int(rng.integers(geometry.capture_words + 40))
        self.chunk = Chunk(
            max(stop, last + 1), writes, reads, end, int(rng.integers(2 * geometry.record_words))
        )

    def _put(self, clock: int, address: int, value: int) -> None:
        """Adds a write at this clock of the chunk, or at the next free one."""
        clock = max(clock, self._first)
        while clock in self._due:
            clock += 1
        self._due[clock] = (address, value & 0xFFFFFFFF)

    def _set(self, clock: int, name: str, value: int | np.integer | np.bool) -> None:
        self._put(clock, ADDRESS[name], int(value))

    def _word(self) -> int:
        return int(self.rng.integers(1 << 32))

    def _later(self, frames: int) -> int:
        return int(self.rng.integers(1, frames * self.size.tick_minimum))

    def _moves(self) -> list[tuple[int, Callable[[int], None]]]:
        """The moves with their relative probabilities."""
        return [
            (30, lambda clock: self._set(clock, "sensor_threshold", self.rng.integers(16))),
            (8, lambda clock: self._set(clock, "sensor_reset_rule", self.rng.integers(4))),
            (8, self._slow),
            (8, lambda clock: self._set(clock, "sensor_pattern", self.rng.integers(4))),
            (8, lambda clock: self._set(clock, "sensor_level", self.rng.integers(256))),
            (12, self._pattern),
            (8, self._window),
            (4, self._tick),
            (4, lambda clock: self._set(clock, "sensor_clear", self.rng.integers(4) > 0)),
            (4, self._pause),
            (4, self._reading),
            (1, self._burst),
            (1, self._show),
            (3, self._prbs),
            (2, lambda clock: self._set(clock, "ctrl_scratch", self._word())),
            (2, self._stray),
            (1, self._reset),
        ]

    def _slow(self, clock: int) -> None:
        """20 kHz for some frames, each of which takes twice as long."""
        self._set(clock, "sensor_clock_select", 1)
        self._set(clock + self._later(24), "sensor_clock_select", 0)

    def _pattern(self, clock: int) -> None:
        first = int(self.rng.integers(self.size.pattern_bytes // 4 + 1))  # the last lies beyond it
        for word in range(first, first + int(self.rng.integers(1, 6))):
            self._put(clock, ADDRESS["pattern_mem"] + 4 * word, self._word())

    def _window(self, clock: int) -> None:
        """A window for some frames: one pixel, one tile, any part, nothing, or beyond the array."""
        size, rng = self.size, self.rng
        row, column = int(rng.integers(size.rows)), int(rng.integers(size.columns))
        last = size.columns - 1
        tile = (size.tiles - 1) * size.lanes
        rows, columns = [
            ((row, row), (column, column)),
            ((0, 0), (0, 0)),
            ((size.rows - 1, size.rows - 1), (last, last)),
            ((0, size.rows - 1), (tile, last)),
            ((0, size.rows - 1), (0, size.lanes - 1)),
            ((row, size.rows - 1), (column, last)),
            ((0, row), (0, column)),
            ((row, size.rows - 1), (0, 0xFFFF)),
            ((1, 0), (0, last)),
            ((0, size.rows - 1), (column, column - 1)),
            ((int(rng.integers(1 << 16)),) * 2, (int(rng.integers(1 << 16)),) * 2),
        ][rng.integers(11)]
        self._set(clock, "sensor_rows", (rows[1] & 0xFFFF) << 16 | rows[0])
        self._set(clock + 1, "sensor_columns", (columns[1] & 0xFFFF) << 16 | columns[0])
        clock += self._later(12)
        self._set(clock, "sensor_rows", (size.rows - 1) << 16)
        self._set(clock + 1, "sensor_columns", last << 16)

    def _tick(self, clock: int) -> None:
        extra = int(self.rng.choice([-3, 0, 1, 2, 7, 40]))
        self._set(clock, "sensor_tick_clocks", self.size.tick_minimum + extra)
        self._set(clock + self._later(6), "sensor_tick_clocks", self.rng.integers(2))

    def _pause(self, clock: int) -> None:
        self._set(clock, "sensor_run", 0)
        self._set(clock + self._later(4), "sensor_run", 1)

    def _reading(self, clock: int) -> None:
        """A reading of the charges, now and then cancelled, or with one behind it."""
        self._set(clock, "sensor_reading", min(self.rng.integers(1, 8, 3)))
        if self.rng.random() < 0.3:
            self._set(clock + self._later(9), "sensor_reading", self.rng.integers(4))

    def _burst(self, clock: int) -> None:
        self._set(clock, "capture_source", self.rng.integers(2))
        self._set(clock + self._later(2), "capture_arm", self.rng.choice([0, 1, 1, 2, 3, 5, 9]))

    def _show(self, clock: int) -> None:
        if self.rng.random() < 0.2:
            self._set(clock, "sink_clear", 1)
        for _ in range(int(self.rng.integers(1, 80))):
            clock += int(self.rng.choice([1, 1, 1, 2, 5, 17]))
            self._set(clock, "sink_data", self._word())
        self._set(clock - self._later(2) % 40, "sink_run", self.rng.integers(4))

    def _prbs(self, clock: int) -> None:
        self._set(clock, "prbs_order", self.rng.choice([7, 15, 23, 31, 8]))
        for _ in range(3):
            self._set(clock + self._later(1), "prbs_check", self._word())

    def _stray(self, clock: int) -> None:
        """A write to no register, to a read-only one, or to one without effect here."""
        read_only = [entry.address for entry in REGISTERS if entry.mode == "ro"]
        places = [*_NOWHERE, *read_only, ADDRESS["uart_clear"], ADDRESS["identifier_mem"]]
        self._put(clock, int(self.rng.choice(places)), self._word())

    def _reset(self, clock: int) -> None:
        if self.rng.random() < 0.5:
            self._set(clock, "ctrl_reset", self.rng.integers(4) > 0)
            self._set(clock + 1, "sensor_tick_clocks", 0)
        self._set(clock + self._later(2), "sensor_run", 1)
