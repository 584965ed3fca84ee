"""Encoder and decoder in Verilator, with the interfaces of the cycle models."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from rtl_model.cycle import Tiles
from rtl_model.events.encoder import OUTPUT, EventSize, Output, Ready
from rtl_model.verilated import VerilatedModule, library
from tests.rtl_model.events.decoder import Decoded, room_for


class _Verilated(VerilatedModule):
    """A module behind a shim. Raises InputError where Verilator is missing."""

    def __init__(self, name: str, size: EventSize, sources: Path | None) -> None:
        shim = Path(__file__).with_name(f"{name}.cpp")
        self.size, self.clock = size, 0
        path = library(f"viform_event_{name}", size, shim, sources=sources)
        super().__init__(path)
        self._library.viform_run.restype = ctypes.c_uint64


class VerilatedEncoder(_Verilated):
    """`viform_event_encoder`, as `EventEncoder`.

    Attributes:
        broken: clocks in which a word changed or went before it was taken.
    """

    def __init__(self, size: EventSize, sources: Path | None = None) -> None:
        super().__init__("encoder", size, sources)
        number, pointer = ctypes.c_uint64, ctypes.c_void_p
        self._library.viform_run.argtypes = [pointer, number, pointer, number, *[pointer] * 3]
        self._counts = np.zeros(3, np.uint64)

    lost_rows = property(lambda self: int(self._counts[0]), doc="As in the model.")
    lost_spikes = property(lambda self: int(self._counts[1]), doc="As in the model.")
    broken = property(lambda self: int(self._counts[2]))

    def run(self, tiles: Tiles, ready: Ready) -> Output:
        """As `EventEncoder.run`."""
        out = np.empty(len(ready), OUTPUT)
        count = self._library.viform_run(
            self._board, len(ready), tiles.ctypes.data, len(tiles), ready.ctypes.data,
            out.ctypes.data, self._counts.ctypes.data,
        )  # fmt: skip
        self.clock += len(ready)
        return out[:count]


class VerilatedDecoder(_Verilated):
    """`viform_event_decoder`, as `EventDecoder`."""

    def __init__(self, size: EventSize, sources: Path | None = None) -> None:
        super().__init__("decoder", size, sources)
        number, pointer = ctypes.c_uint64, ctypes.c_void_p
        self._library.viform_run.argtypes = [
            pointer, number, number, pointer, number, pointer, pointer, number, *[pointer] * 3,
        ]  # fmt: skip
        self._counts = np.zeros(6, np.uint64)

    packets = property(lambda self: int(self._counts[3]), doc="As in the model.")
    damaged = property(lambda self: int(self._counts[4]), doc="As in the model.")
    broken = property(lambda self: int(self._counts[5]))

    def run(self, halves: Output, offered: Ready, ready: Ready, clocks: int, idle: int) -> Decoded:
        """As `EventDecoder.run`."""
        words, gaps = room_for(halves, offered, ready, self.size)
        self.clock += self._library.viform_run(
            self._board, clocks, idle, halves.ctypes.data, len(halves), offered.ctypes.data,
            ready.ctypes.data, len(ready), words.ctypes.data, gaps.ctypes.data,
            self._counts.ctypes.data,
        )  # fmt: skip
        taken, count, places = (int(n) for n in self._counts[:3])
        return Decoded(words[:count], gaps[:places], taken)
