"""Verilog and cycle model side by side under one program: stopped at the first difference.

Tiles are compared as they are computed (clock, frame, row, tile, bits), and what the sink shows.
Between chunks of the program every register that can be read is read at the same clock on both
sides, and what stands in the capture memory once a burst is over.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtl_model.cycle import System, Tiles
from rtl_model.lockstep.coverage import Coverage
from rtl_model.lockstep.difference import Difference, first_difference
from rtl_model.lockstep.program import ADDRESS, Chunk, Program
from rtl_model.registers import REGISTERS, mask
from rtl_model.verilated import VerilatedSystem, Waves, trace_format

__all__ = ["Outcome", "run"]

_ENDLESS = 1 << 62
# armed: a burst may begin between two reads
_MOVING = mask("capture_state", "armed") | mask("capture_state", "busy")
_DONE = mask("capture_state", "done")
_NAMES = {entry.address: entry.name for entry in REGISTERS}
_CAPTURE = {ADDRESS[f"capture_{name}"] for name in ("state", "level", "pointer", "rows", "lost")}


@dataclass
class Outcome:
    """What a run came to: clocks and pixel-cycles (pixels of the tiles that were compared, whether
    in the window or not), what was covered, and the first difference if there is one."""

    clock: int
    pixels: int
    coverage: Coverage
    difference: Difference | None


class _Stop(Exception):
    """The clock to stop at is reached."""


def run(
    program: Program,
    *,
    pixels: float = 1e8,
    until: int | None = None,
    sources: Path | None = None,
    waves: Path | None = None,
    window: int = 256,
    progress: Callable[[int, int], None] | None = None,
) -> Outcome:
    """Compares until `pixels` pixel-cycles are reached, clock `until`, or a difference.

    sources: folder of Verilog; None is the design's own.
    waves: file for waveforms of the `window` clocks before the difference and a quarter as many
        after it, .fst or .vcd; nothing is written where there is no difference.
    progress: called after each chunk with clocks and pixel-cycles so far; it may raise.

    Raises InputError where Verilator is missing or the waveforms' name cannot be used.
    """
    if waves is not None:
        trace_format(waves)
    with contextlib.closing(VerilatedSystem(program.geometry, sources=sources)) as verilog:
        outcome = _Lockstep(program, verilog, _ENDLESS if until is None else until).run(
            pixels, progress
        )
    found = outcome.difference
    if found is not None:
        found.sources = sources
    if waves is not None and found is not None:
        first, last = max(0, found.clock - window), found.until + window // 4
        with contextlib.closing(
            VerilatedSystem(program.geometry, sources=sources, waves=Waves(waves, first, last))
        ) as verilog:
            _Lockstep(program, verilog, found.until).run(_ENDLESS, None)
            verilog.run(max(0, last - verilog.clock))
        found.waves = waves
    return outcome


class _Lockstep:
    def __init__(self, program: Program, verilog: VerilatedSystem, until: int) -> None:
        self.program, self.verilog, self.until = program, verilog, until
        self.model = System(program.geometry)
        self.coverage = Coverage(program.geometry)
        self.pixels = 0
        self.found: Difference | None = None

    def run(self, pixels: float, progress: Callable[[int, int], None] | None) -> Outcome:
        number = 0
        with contextlib.suppress(_Stop):
            while self.pixels < pixels:
                chunk = self.program.chunk(number, self.model.clock)
                self._run(chunk)
                self._look(chunk)
                number += 1
                if progress is not None:
                    progress(self.model.clock, self.pixels)
        return Outcome(self.model.clock, self.pixels, self.coverage, self.found)

    def _run(self, chunk: Chunk) -> None:
        """Runs the writes of a chunk and compares the tiles."""
        clocks = min(chunk.stop, self.until) - self.model.clock
        if clocks > 0:
            writes = [write for write in chunk.writes if write.clock < self.until]
            made = self.verilog.run(clocks, writes), self.model.run(clocks, writes)
            self.coverage.wrote(writes)
            self._compare(*made)
        if self.model.clock >= self.until:
            raise _Stop

    def _compare(self, made: Tiles, wanted: Tiles) -> None:
        shown, due = self.verilog.shown(), self.model.shown()
        self.coverage.shown += len(due)
        found = []
        if not np.array_equal(made, wanted):
            found.append(first_difference(self.program, made, wanted, ""))
        if not np.array_equal(shown, due):
            found.append(first_difference(self.program, shown, due, "the sink's "))
        if found:
            self.found = min(found, key=lambda difference: difference.clock)
            raise _Stop
        self.pixels += self.coverage.saw(wanted)

    def _look(self, chunk: Chunk) -> None:
        """Reads the registers, and the capture memory where it stands still."""
        state = self._read(ADDRESS["capture_state"], compared=False)
        still = not (state[0] | state[1]) & _MOVING
        for address in chunk.reads:
            self._read(address, compared=still or address not in _CAPTURE)
        if still and state[0] & state[1] & _DONE:
            for _ in range(chunk.drain):
                self._read(ADDRESS["capture_data"])
            if chunk.pointer & 1:
                self._write(ADDRESS["capture_pointer"], chunk.pointer)
                for _ in range(4):
                    self._read(ADDRESS["capture_data"])
            self.coverage.bursts += chunk.drain > 0
        self._tiles()

    def _tiles(self) -> None:
        self._compare(self.verilog.run(0), self.model.run(0))

    def _room_for(self, clocks: int) -> None:
        """Ends the run at its last clock where an access of `clocks` clocks finds no room."""
        left = self.until - self.model.clock
        if clocks > left:
            self._compare(self.verilog.run(left), self.model.run(left))
            raise _Stop

    def _write(self, address: int, value: int) -> None:
        self._room_for(1)
        self.verilog.write(address, value)
        self.model.write(address, value)

    def _read(self, address: int, *, compared: bool = True) -> tuple[int, int]:
        clock = self.model.clock
        self._room_for(2)
        values = self.verilog.read(address), self.model.read(address)
        self.coverage.reads += compared
        if compared and values[0] != values[1]:
            self._tiles()  # a tile that differs earlier says more
            what = _NAMES.get(address, f"word 0x{address:x}")
            self.found = Difference(
                self.program, what, clock, None, None, None, *values, until=clock + 2
            )
            raise _Stop
        return values
