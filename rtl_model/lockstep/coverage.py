"""Coverage of a lockstep run: the settings under which each tile was computed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from rtl_model.cycle import Tiles
from rtl_model.geometry import Geometry
from rtl_model.lockstep.program import ADDRESS, Write
from rtl_model.registers import REGISTERS, parameters, reset_value

_AT_TILE = ("sensor_threshold", "sensor_reset_rule", "sensor_pattern")
_AT_FRAME = ("sensor_clock_select", "sensor_rows", "sensor_columns")
_SHAPE = (16, 4, 4, 2)


class Coverage:
    """Counts over the tiles that were compared.

    Attributes:
        pixels: pixels of those tiles by (threshold, reset rule, pattern, clock select), int64.
        windows: number of tiles by kind of window, such as "whole", "one pixel" or "one tile".
        spikes: compared spikes.
        bursts: drained bursts.
        sink_tiles: compared tiles of the sink.
        reads, writes: accesses to the bus.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.pixels = np.zeros(_SHAPE, np.int64)
        self.windows: Counter[str] = Counter()
        self.spikes = self.bursts = self.sink_tiles = self.reads = self.writes = 0
        values = parameters(geometry)
        self._resets = {
            entry.name: reset_value(entry, values)
            for entry in REGISTERS
            if entry.name in (*_AT_TILE, *_AT_FRAME)
        }
        self._names = {ADDRESS[name]: name for name in self._resets}
        self._masks = {entry.name: (1 << entry.width) - 1 for entry in REGISTERS}
        self._lines = {
            name: (np.array([-1]), np.array([value])) for name, value in self._resets.items()
        }

    def add_writes(self, writes: Iterable[Write]) -> None:
        """Records writes to the sensor's registers, in order of clock."""
        changes: dict[str, list[tuple[int, int]]] = {}
        for clock, address, value in writes:
            self.writes += 1
            if address in self._names:
                name = self._names[address]
                changes.setdefault(name, []).append((clock, value & self._masks[name]))
            elif address == ADDRESS["ctrl_reset"] and value & 1:
                for name, reset in self._resets.items():
                    changes.setdefault(name, []).append((clock, reset))
        for name, added in changes.items():
            clocks, values = self._lines[name]
            new = np.array(added)
            self._lines[name] = np.append(clocks, new[:, 0]), np.append(values, new[:, 1])

    def add_tiles(self, tiles: Tiles) -> int:
        """Counts tiles computed after the recorded writes; returns the number of their pixels."""
        if not tiles.size:
            return 0
        size = self.geometry
        clock = tiles["clock"].astype(np.int64)
        start = clock - 1 - tiles["row"].astype(np.int64) * size.row_clocks - tiles["tile"]
        first, settings = int(start[0]), {}
        for name, (clocks, values) in self._lines.items():
            at = clock if name in _AT_TILE else start
            # A write at edge w takes effect at later edges.
            settings[name] = values[np.searchsorted(clocks, at, side="left") - 1]
            keep = max(0, int(np.searchsorted(clocks, first, side="left")) - 1)
            self._lines[name] = clocks[keep:], values[keep:]
        last = size.columns - (size.tiles - 1) * size.lanes
        pixels = np.where(tiles["tile"] == size.tiles - 1, last, size.lanes)
        code = np.ravel_multi_index(
            tuple(settings[name] for name in (*_AT_TILE, "sensor_clock_select")), _SHAPE
        )
        counts = np.bincount(code, weights=pixels, minlength=self.pixels.size)
        self.pixels += counts.astype(np.int64).reshape(_SHAPE)
        self.spikes += int(np.bitwise_count(tiles["bits"]).sum())
        self._count_windows(settings["sensor_rows"], settings["sensor_columns"])
        return int(pixels.sum())

    def _count_windows(self, rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]) -> None:
        size = self.geometry
        pairs, counts = np.unique(
            rows.astype(np.uint64) << np.uint64(32) | columns.astype(np.uint64), return_counts=True
        )
        for pair, count in zip(pairs.tolist(), counts.tolist(), strict=True):
            row, column = (pair >> 32) & 0xFFFF, pair & 0xFFFF
            row_end = min(pair >> 48, size.rows - 1)
            column_end = min((pair >> 16) & 0xFFFF, size.columns - 1)
            wide, high = column_end - column + 1, row_end - row + 1
            tile = column // size.lanes == column_end // size.lanes
            if wide == size.columns and high == size.rows:
                kind = "whole"
            elif wide <= 0:
                kind = "no column"
            elif wide == high == 1:
                kind = "one pixel"
            elif tile and column == (size.tiles - 1) * size.lanes and wide < size.lanes:
                kind = "partly-filled tile"
            elif tile:
                kind = "one tile"
            else:
                kind = "part"
            self.windows[kind] += count
