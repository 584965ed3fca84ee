"""For waveforms: the verilated board at its pins, and a view of its signals.

`gtkwave FILE.gtkw` opens trace and view. The format is GTKWave's save file (GTKWave User's Guide,
appendix "Save file format"): marker times are in steps of the trace, which are picoseconds here.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.files.atomic import atomic_write
from rtl_model.cycle.array import TILE, Tiles
from rtl_model.geometry import Geometry
from rtl_model.verilated.build import library
from rtl_model.verilated.system import VerilatedModule, Waves

_SHIM = Path(__file__).with_name("pins.cpp")
_BITS = 10
_TILES = ("tile_valid", "tile_frame[31:0]", "tile_row[15:0]", "tile_index[15:0]")
_BUS = ("bus_we", "bus_re", "bus_adr[29:0]", "bus_wdata[31:0]", "bus_rvalid", "bus_rdata[31:0]")
_MARKERS = 26  # A to Z
_HEXADECIMAL = "@22"


class VerilatedPins(VerilatedModule):
    """`viform_board` in Verilator, with a host that sends 8N1 at the board's baud.

    Args:
        geometry: geometry of the build.
        waves: waveforms to write. The file is complete when the board is closed.

    Attributes:
        clock: edges passed since reset.

    Raises:
        InputError: if Verilator is missing or the waveforms cannot be written.
    """

    def __init__(self, geometry: Geometry, waves: Waves) -> None:
        self.geometry, self.clock = geometry, 0
        path = library("viform_board", geometry, _SHIM, trace=waves.format)
        super().__init__(path)
        number, pointer, text = ctypes.c_uint64, ctypes.c_void_p, ctypes.c_char_p
        self._library.viform_waves.argtypes = [pointer, text, number, number]
        self._library.viform_send.restype = number
        self._library.viform_send.argtypes = [pointer, text, number, number, pointer, number]
        opened = self._library.viform_waves(
            self._board, str(waves.path).encode(), waves.first, waves.last
        )
        if not opened:
            self.close()
            raise InputError(
                f"{waves.path}", "a file that can be written", "refused", "choose another name"
            )

    def line_clocks(self, count: int) -> int:
        """Duration of `count` bytes on the line, clocks."""
        return count * _BITS * self.geometry.bit_clocks

    def send(self, data: bytes, idle: int = 0) -> Tiles:
        """Sends bytes, then runs `idle` clocks; returns the tiles computed meanwhile."""
        clocks = self.line_clocks(len(data)) + idle
        tiles = np.empty(clocks, TILE)  # at most one tile a clock
        count = self._library.viform_send(
            self._board, data, len(data), idle, tiles.ctypes.data, clocks
        )
        self.clock += clocks
        return tiles[:count].copy()


def board_signals(geometry: Geometry) -> list[str]:
    """Signals of a trace of `viform_board`: the clock, the line, the bus and the tiles."""
    top = "TOP.viform_board."
    names = ["clk", "serial_rx", "serial_tx", *(f"core.{name}" for name in _BUS), *_TILES]
    return [top + name for name in [*names, f"tile_bits[{geometry.lanes - 1}:0]"]]


def system_signals(geometry: Geometry) -> list[str]:
    """Signals of a trace of `viform_system`: the clock, the bus and the tiles."""
    top = "TOP.viform_system."
    return [top + name for name in ["clk", *_BUS, *_TILES, f"tile_bits[{geometry.lanes - 1}:0]"]]


def write_view(
    trace: Path, geometry: Geometry, signals: Sequence[str], cursor: int, marks: Sequence[int]
) -> Path:
    """Writes the view beside a trace, with the ending .gtkw, and returns its path.

    Args:
        trace: file of waveforms.
        geometry: geometry of the build.
        signals: names with their scopes.
        cursor: clock of the primary marker.
        marks: clocks of the markers A, B, ...; 26 at most are used.
    """
    times = [_picoseconds(clock, geometry) for clock in (cursor, *marks[:_MARKERS])]
    times += [-1] * (1 + _MARKERS - len(times))
    path = trace.with_suffix(".gtkw")
    lines = [
        f'[dumpfile] "{trace.absolute()}"', f'[savefile] "{path.absolute()}"',
        f"[timestart] {times[0]}", "*-18 " + " ".join(str(time) for time in times),
        _HEXADECIMAL, *signals,
    ]  # fmt: skip
    with atomic_write(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _picoseconds(clock: int, geometry: Geometry) -> int:
    return clock * 10**12 // geometry.clock_hz
