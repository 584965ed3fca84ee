"""The verilated board at its pins: a host's bytes in, tiles out, for waveforms with the line."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from cosim import InputError
from rtl_model.cycle.tiles import TILE, Tiles
from rtl_model.geometry import Geometry
from rtl_model.verilated.build import library
from rtl_model.verilated.module import VerilatedModule
from rtl_model.verilated.system import Waves

_SHIM = Path(__file__).with_name("pins.cpp")
_BITS = 10


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
