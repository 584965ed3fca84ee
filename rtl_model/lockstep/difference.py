"""Findings of a lockstep run: the settings under which each tile was computed, and the first
difference between Verilog and cycle model with the command that reproduces it.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import one_line
from rtl_model.cycle import Tiles
from rtl_model.geometry import Geometry
from rtl_model.lockstep.program import ADDRESS, Program, Write
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


@dataclass
class Difference:
    """A difference.

    Attributes:
        program: program of the run.
        what: the value that differs: "spike", "tile" or a field of a tile, after "the sink's " for
            one of the sink; or the name of a register.
        clock: edge at which the tile was computed, or the read strobed.
        frame, row, column: frame, row and column of the pixel; None for a register.
        verilog, model: the two values; None for a missing tile.
        until: clock after which the difference is visible.
        waves: file of waveforms, None if not written.
        view: GTKWave's view of them, None if not written.
        sources: folder of the Verilog; None for the design's.
    """

    program: Program
    what: str
    clock: int
    frame: int | None
    row: int | None
    column: int | None
    verilog: int | None
    model: int | None
    until: int
    waves: Path | None = None
    view: Path | None = None
    sources: Path | None = None

    @property
    def reproducer(self) -> str:
        """The command that reproduces the difference."""
        program = self.program
        return (
            f"viform board compare --lockstep --rows {program.rows} --columns {program.columns} "
            f"--lanes {program.lanes} --seed {program.seed} --until {self.until}"
            + ("" if self.sources is None else f" --sources {shlex.quote(str(self.sources))}")
        )

    def __str__(self) -> str:
        place = f"clock {self.clock}"
        if self.frame is not None:
            place += f", frame {self.frame}, row {self.row}, column {self.column}"
        lines = [
            f"{place}: {self.what} is {_value(self.verilog)} in the Verilog, "
            f"{_value(self.model)} in the model",
            f"reproduce: {self.reproducer}",
        ]
        if self.waves is not None:
            lines.append(one_line(f"waveforms: {self.waves}, displayed by `gtkwave {self.view}`"))
        return "\n".join(lines)


def _value(value: int | None) -> str:
    if value is None:
        return "missing"
    return str(value) if value < 10 else f"{value} (0x{value:x})"


def first_difference(program: Program, verilog: Tiles, model: Tiles, what: str) -> Difference:
    """The first difference of two unequal lists of tiles.

    Args:
        program: program of the run.
        verilog, model: the lists.
        what: prefix of the field's name, "" for tiles of the pixels.
    """
    count = min(len(verilog), len(model))
    unequal = np.flatnonzero(verilog[:count] != model[:count])
    at = int(unequal[0]) if unequal.size else count
    here = None if at >= len(verilog) else verilog[at]
    there = None if at >= len(model) else model[at]
    lanes = program.lanes

    def difference(name: str, tile: np.void, one: int | None, two: int | None, bit: int = 0):  # type: ignore[no-untyped-def]
        clock = int(tile["clock"]) & 0xFFFFFFFF if one is None else int(tile["clock"])
        return Difference(
            program,
            f"{what}{name}",
            clock,
            int(tile["frame"]),
            int(tile["row"]),
            int(tile["tile"]) * lanes + bit,
            one,
            two,
            clock + 1,
        )

    if there is not None and (here is None or there["clock"] < here["clock"]):
        return difference("tile", there, None, int(there["bits"]))  # the model has one more
    if here is not None and (there is None or here["clock"] < there["clock"]):
        return difference("tile", here, int(here["bits"]), None)
    assert here is not None and there is not None, "the lists are equal"
    for name in ("clock", "frame", "row", "tile"):
        if here[name] != there[name]:
            return difference(f"{name} of the tile", there, int(here[name]), int(there[name]))
    wrong = int(here["bits"]) ^ int(there["bits"])
    bit = (wrong & -wrong).bit_length() - 1
    one, two = (int(tile["bits"]) >> bit & 1 for tile in (here, there))
    return difference("spike", there, one, two, bit)
