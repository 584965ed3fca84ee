"""What stands behind the virtual board's line: the cycle model, or the Verilog at bytes or pins.

All of them take bytes, run a number of clocks and give bytes back.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from rtl_model.geometry import Geometry
from rtl_model.virtual.faults import Faults
from rtl_model.virtual.noise import noise

if TYPE_CHECKING:
    from rtl_model.cycle import Behind

__all__ = ["ROOM", "Level", "Simulator", "make_simulator"]

Level = Literal["bytes", "pins", "model"]

ROOM = 4096
"""Bytes taken, and given back, at once."""
_SEED = 1  # of the noise


class Simulator(Protocol):
    """A board and its side of the line.

    Attributes:
        clock: edges since power-on.
        backlog: bytes that wait or are under way on the line.
    """

    clock: int
    backlog: int

    def step(self, data: bytes, clocks: int) -> bytes:
        """Takes at most ROOM bytes for the board and runs: while anything is under way until it is
        over, otherwise `clocks` clocks, and never more; returns the bytes that came out."""
        ...

    def set_baud(self, baud: int) -> None:
        """The host speaks at `baud` from now on."""
        ...

    def power_cycle(self) -> None:
        """The board starts anew, at clock 0."""
        ...

    def close(self) -> None:
        """Gives back what it holds."""
        ...


def make_simulator(
    level: Level, geometry: Geometry, faults: Faults, imager: str | None = None
) -> Simulator:
    """Returns a board of `level`, or an imager by its kind's name. The Verilog is compiled where it
    was not before: InputError where the tools for it are missing."""
    if imager is not None:
        from rtl_model.imagers.catalogue import bus_target
        from rtl_model.imagers.device.bus import ImagerBus

        return _Model(lambda: ImagerBus(bus_target(imager), geometry))
    if level == "model":
        from rtl_model.virtual.planted import FaultySystem

        return _Model(lambda: FaultySystem(geometry, faults, keep=False))
    return _Verilog(level, geometry, faults)


class _Model:
    """A cycle model behind its bridge, whose line takes a clock a byte. make: gives one that has
    just been switched on."""

    def __init__(self, make: Callable[[], Behind]) -> None:
        self._make = make
        self.backlog = 0
        self.power_cycle()

    def power_cycle(self) -> None:
        from rtl_model.cycle import Bridge

        self._bridge = Bridge(system=self._make(), byte_clocks=1)
        self.clock = 0

    def step(self, data: bytes, clocks: int) -> bytes:
        if not data:
            self.clock += clocks
            self._bridge.wait(self.clock)
            return b""
        reply = self._bridge.feed(data, self.clock)
        self.clock = max(self._bridge.system.clock, *reply.clocks, 0) + 1
        return reply.data

    def set_baud(self, baud: int) -> None:
        """Its line knows none."""

    def close(self) -> None:
        """Holds nothing."""


class _Verilog:
    """The Verilog in Verilator, with the shim of its level."""

    def __init__(self, level: Level, geometry: Geometry, faults: Faults) -> None:
        self._geometry, self._faults = geometry, faults
        self._library = _load(level, geometry, faults)
        self._out = ctypes.create_string_buffer(ROOM)
        self._clock, self._made = ctypes.c_uint64(), ctypes.c_uint64()
        self._taken = self._given = 0  # bytes, which is what noise hangs on
        self._baud = geometry.baud
        self._board: int | None = None
        self._masks = (np.zeros(ROOM, np.uint16), np.zeros(2 * ROOM, np.uint16))
        self._pointers = (self._masks[0].ctypes.data, self._masks[1].ctypes.data)
        self._masked = -2 * ROOM  # the byte that the second array's first mask is for
        self.power_cycle()

    def power_cycle(self) -> None:
        self.close()
        self._board = self._library.viform_open()
        self.clock = self.backlog = 0
        self.set_baud(self._baud)

    def step(self, data: bytes, clocks: int) -> bytes:
        rx, tx = self._pointers
        if self._faults.noise:
            tx += self._draw(len(data))
        self.backlog = self._library.viform_step(
            self._board, data, rx, len(data), clocks, self._out, tx, ROOM, self._clock, self._made
        )
        made = self._made.value
        self.clock = self._clock.value
        self._taken += len(data)
        self._given += made
        return self._out.raw[:made] if made else b""

    def _draw(self, count: int) -> int:
        """Draws the masks of the next bytes; returns by how many bytes of memory those that come
        out have moved on."""
        share = self._faults.noise
        self._masks[0][:count] = noise(share, _SEED, "rx", self._taken, count)
        if self._given - self._masked > ROOM:
            self._masked = self._given
            self._masks[1][:] = noise(share, _SEED, "tx", self._given, 2 * ROOM)
        return (self._given - self._masked) * self._masks[1].itemsize

    def set_baud(self, baud: int) -> None:
        self._baud = baud
        real = baud * (1 + self._faults.baud_error)
        self._library.viform_line(self._board, self._geometry.clock_hz / real)

    def close(self) -> None:
        if self._board is not None:
            self._library.viform_close(self._board)
        self._board = None


def _load(level: Level, geometry: Geometry, faults: Faults) -> ctypes.CDLL:
    from rtl_model.verilated import VERILOG, build_crc, library
    from rtl_model.virtual.planted import plant

    name = "core" if level == "bytes" else "board"
    shim = Path(__file__).with_name(f"{name}.cpp")
    with tempfile.TemporaryDirectory() as text:
        sources = VERILOG
        if faults.of_design:
            sources = Path(text)
            plant(VERILOG, sources, geometry, faults)
        build = build_crc(geometry, sources)
        path = library(f"viform_{name}", geometry, shim, sources=sources, build=build)
    loaded = ctypes.CDLL(str(path))
    pointer, number = ctypes.c_void_p, ctypes.c_uint64
    loaded.viform_open.restype = pointer
    loaded.viform_close.argtypes = [pointer]
    loaded.viform_line.argtypes = [pointer, ctypes.c_double]
    loaded.viform_step.argtypes = [
        pointer, ctypes.c_char_p, pointer, number, number, ctypes.c_char_p, pointer, number,
        ctypes.POINTER(number), ctypes.POINTER(number),
    ]  # fmt: skip
    return loaded
