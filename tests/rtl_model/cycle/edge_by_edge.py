"""The sensor in numpy, one rising edge at a time: the slow reference of the compiled scan.

`EdgeByEdgeSensor.edge` does what the Verilog does at one rising edge.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtl_model.cycle.array import TILE, Tiles
from rtl_model.cycle.planes import increments, step
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS, parameters, quantum, reset_value

_NAMES = {entry.address: entry for entry in REGISTERS if entry.name.startswith("sensor_")}
_PATTERN = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")


class EdgeByEdgeSensor:
    """The registers `sensor_*`, the pattern memory and the pixels of a board at clock 0."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        values = parameters(geometry)
        self.registers = {entry.name: reset_value(entry, values) for entry in _NAMES.values()}
        wide = geometry.tiles * geometry.lanes
        self.memory = np.zeros(geometry.rows * wide, np.int64)
        self.fetched = self.memory  # as the memory stood at the last edge
        self.charge = np.zeros((geometry.rows, wide), np.int64)
        self.clock = 0
        self.pending_clear = True
        self.start: int | None = None
        self.frame = 0
        self.request = self.levels = self.passed = 0  # of a reading; passes begun
        self.reading = False

    def run(self, clocks: int, writes: Iterable[tuple[int, int, int]] = ()) -> Tiles:
        """Runs `clocks` edges with writes (clock, byte address, value) and returns the tiles."""
        due = {clock: (address, value) for clock, address, value in writes}
        made = []
        for clock in range(self.clock, self.clock + clocks):
            made += self.edge(*due.get(clock, (None, 0)))
        return np.array(made, TILE)

    def edge(self, address: int | None, value: int) -> list[tuple[int, int, int, int, int]]:
        """One rising edge, at which `value` is written to `address` if that is not None."""
        tiles = []
        seen = self.fetched  # read at the edge before
        self.fetched = self.memory
        if self.start is None or self.clock >= self.start + self.period:
            self._maybe_begin()
        elif self.clock > self.start:
            tiles = self._tile(seen, self.clock - self.start - 1)
        if address is not None:
            self._write(address, value)
        self.clock += 1
        return tiles

    def _maybe_begin(self) -> None:
        get = self.registers
        self.start = None
        follows = 0 < self.passed < self.levels - 1
        if not (get["sensor_run"] or follows or self.request):
            return
        self.start = self.clock
        self.select = get["sensor_clock_select"]
        tick = max(get["sensor_tick_clocks"], self.geometry.tick_minimum)
        self.period = tick * (2 if self.select else 1)
        self.rows, self.columns = get["sensor_rows"], get["sensor_columns"]
        self.reading = bool(follows or self.request)
        if self.reading:
            if not follows:
                self.levels, self.passed, self.request = 1 << self.request, 0, 0
                self.q = quantum(get["sensor_threshold"])
            self.passed += 1
            self.seen = self.charge * (not self.pending_clear)
            return
        self.frame = 0 if self.pending_clear else self.frame + 1
        if self.pending_clear:
            self.charge[:] = 0
        self.pending_clear = False

    def _tile(
        self, memory: np.ndarray[tuple[int], np.dtype[np.int64]], passed: int
    ) -> list[tuple[int, int, int, int, int]]:
        size, get = self.geometry, self.registers
        row, tile = divmod(passed, size.row_clocks)
        if row >= size.rows or tile >= size.tiles:
            return []
        column = tile * size.lanes + np.arange(size.lanes)
        bytes_ = memory.reshape(self.charge.shape)[row, column]
        electrons = increments(
            get["sensor_pattern"],
            get["sensor_level"],
            self.frame,
            np.array(row),
            column,
            bytes_,
        )
        held = (column < self.columns & 0xFFFF) | (column > self.columns >> 16)
        held |= column >= size.columns
        shown = self.rows & 0xFFFF <= row <= self.rows >> 16
        if self.reading:
            above = self.levels * self.seen[row, column] >= self.passed * self.q
            bits = sum(1 << int(lane) for lane in np.flatnonzero(above & ~held))
            return [(self.clock, self.passed, row, tile, bits)] if shown else []
        q = quantum(get["sensor_threshold"])
        scale = 2 if self.select else 1
        rest, fired = step(self.charge[row, column], scale * electrons, q, get["sensor_reset_rule"])
        self.charge[row, column] = np.where(held | (not shown), 0, rest)
        if not shown:
            return []
        bits = sum(1 << int(lane) for lane in np.flatnonzero(fired & ~held))
        return [(self.clock, self.frame, row, tile, bits)]

    def _write(self, address: int, value: int) -> None:
        if address in _NAMES:
            entry = _NAMES[address]
            if entry.name == "sensor_clear":
                self.pending_clear |= bool(value & 1)
            elif entry.name == "sensor_reading":
                self.request = value & 7
            elif entry.mode == "rw":
                self.registers[entry.name] = value & ((1 << entry.width) - 1)
        elif 0 <= address - _PATTERN < self.geometry.pattern_bytes:
            self.memory = self.memory.copy()
            for n in range(4):
                self.memory[address - _PATTERN + n] = value >> 8 * n & 255
