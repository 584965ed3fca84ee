"""Runs Verilog and cycle model under the same program and stops at the first difference.

All tiles of the pixels and of the sink are compared (clock, frame, row, tile, bits). Between chunks
of the program every readable register is read at the same clock on both sides, as is the capture
memory after a burst.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtl_model.cycle import System, Tiles
from rtl_model.lockstep.difference import Coverage, Difference, first_difference
from rtl_model.lockstep.program import ADDRESS, Chunk, Program
from rtl_model.registers import REGISTERS, mask
from rtl_model.verilated import (
    VerilatedSystem,
    Waves,
    system_signals,
    trace_format,
    write_view,
)

_ENDLESS = 1 << 62
# States in which the capture registers may change between two reads.
_MOVING = mask("capture_state", "armed") | mask("capture_state", "busy")
_DONE = mask("capture_state", "done")
_NAMES = {entry.address: entry.name for entry in REGISTERS}
_CAPTURE = {ADDRESS[f"capture_{name}"] for name in ("state", "level", "pointer", "rows", "lost")}


@dataclass
class Outcome:
    """Result of a run.

    Attributes:
        clock: number of clocks.
        pixels: pixel-cycles, which are the pixels of all compared tiles, in the window or not.
        coverage: coverage of the sensor's settings.
        difference: the first one, None if there is none.
    """

    clock: int
    pixels: int
    coverage: Coverage
    difference: Difference | None


class _Stop(Exception):
    """Ends the run: its last clock is reached, or there is a difference."""


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
    """Compares until `pixels` pixel-cycles, clock `until`, or the first difference.

    Args:
        program: program for both sides.
        pixels: pixel-cycles after which the run ends.
        until: clock at which the run ends, None for no limit.
        sources: folder of the Verilog; the design's if None.
        waves: file for waveforms around the difference, .fst or .vcd. Without a difference it is
            not written.
        window: clocks of the waveforms before the difference; a quarter as many follow it.
        progress: called after each chunk with the clocks and pixel-cycles so far; it may raise.

    Raises:
        InputError: if Verilator is missing or the name of the waveforms cannot be used.
    """
    if waves is not None:
        trace_format(waves)
    with contextlib.closing(VerilatedSystem(program.geometry, sources=sources)) as verilog:
        outcome = _Lockstep(program, verilog, _ENDLESS if until is None else until).run(
            pixels, progress
        )
    difference = outcome.difference
    if difference is not None:
        difference.sources = sources
    if waves is not None and difference is not None:
        first, last = max(0, difference.clock - window), difference.until + window // 4
        with contextlib.closing(
            VerilatedSystem(program.geometry, sources=sources, waves=Waves(waves, first, last))
        ) as verilog:
            _Lockstep(program, verilog, difference.until).run(_ENDLESS, None)
            verilog.run(max(0, last - verilog.clock))
        difference.waves = waves
        geometry = program.geometry
        difference.view = write_view(
            waves, geometry, system_signals(geometry), difference.clock, [difference.clock]
        )
    return outcome


class _Lockstep:
    """One run, up to clock `until`."""

    def __init__(self, program: Program, verilog: VerilatedSystem, until: int) -> None:
        self.program, self.verilog, self.until = program, verilog, until
        self.model = System(program.geometry)
        self.coverage = Coverage(program.geometry)
        self.pixels = 0
        self.difference: Difference | None = None

    def run(self, pixels: float, progress: Callable[[int, int], None] | None) -> Outcome:
        number = 0
        with contextlib.suppress(_Stop):
            while self.pixels < pixels:
                chunk = self.program.chunk(number, self.model.clock)
                self._run(chunk)
                self._compare_registers(chunk)
                number += 1
                if progress is not None:
                    progress(self.model.clock, self.pixels)
        return Outcome(self.model.clock, self.pixels, self.coverage, self.difference)

    def _run(self, chunk: Chunk) -> None:
        """Runs the writes of a chunk and compares the tiles."""
        clocks = min(chunk.stop, self.until) - self.model.clock
        if clocks > 0:
            writes = [write for write in chunk.writes if write.clock < self.until]
            tiles = self.verilog.run(clocks, writes), self.model.run(clocks, writes)
            self.coverage.add_writes(writes)
            self._compare(*tiles)
        if self.model.clock >= self.until:
            raise _Stop

    def _compare(self, verilog: Tiles, model: Tiles) -> None:
        """Compares the tiles of the pixels, and those of the sink."""
        sinks = self.verilog.sink_tiles(), self.model.sink_tiles()
        self.coverage.sink_tiles += len(sinks[1])
        differences = []
        if not np.array_equal(verilog, model):
            differences.append(first_difference(self.program, verilog, model, ""))
        if not np.array_equal(*sinks):
            differences.append(first_difference(self.program, *sinks, "the sink's "))
        if differences:
            self.difference = min(differences, key=lambda difference: difference.clock)
            raise _Stop
        self.pixels += self.coverage.add_tiles(model)

    def _compare_registers(self, chunk: Chunk) -> None:
        """Reads and compares the registers, and the capture memory if no burst is in progress."""
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
            self._read(
                ADDRESS["capture_mem"] + 4 * (chunk.pointer % self.model.geometry.capture_words)
            )
            self.coverage.bursts += chunk.drain > 0
        if ADDRESS["write_mem"] in chunk.reads:
            self._numbered_write(chunk.pointer)
        self._tiles()

    def _numbered_write(self, draw: int) -> None:
        """Writes two words to the pattern memory by `write_mem`, with the next or a wrong number.

        Args:
            draw: any number, from which the details follow.
        """
        place, words = ADDRESS["write_mem"], self.model.geometry.pattern_bytes // 4
        number = self._read(place)[1] + draw % 2
        target = ADDRESS["pattern_mem"] + 4 * (draw % words) + draw // 2 % 2
        for index, value in enumerate((number, target, 2, ~draw & 0xFFFFFFFF, draw)):
            self._write(place + 4 * index, value)
        self._read(place)
        self._read(place + 4)
        for word in {draw % words, (draw + 1) % words}:
            self._read(ADDRESS["pattern_mem"] + 4 * word)

    def _tiles(self) -> None:
        self._compare(self.verilog.run(0), self.model.run(0))

    def _room_for(self, clocks: int) -> None:
        """Ends the run at its last clock if an access of `clocks` clocks would exceed it."""
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
            self._tiles()  # an earlier difference of a tile takes precedence
            what = _NAMES.get(address, f"word 0x{address:x}")
            self.difference = Difference(
                self.program, what, clock, None, None, None, *values, until=clock + 2
            )
            raise _Stop
        return values
