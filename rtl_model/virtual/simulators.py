"""Simulators behind the virtual board's line: cycle model, or Verilog at byte or pin level.

Each takes bytes, runs a number of clocks and returns bytes. Verilator and the models are imported
in the functions that need them, because they take long to load.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from rtl_model.geometry import Geometry
from rtl_model.registers.design import Device
from rtl_model.virtual.faults import Faults
from rtl_model.virtual.line import noise

if TYPE_CHECKING:
    from rtl_model.cycle import Behind

Level = Literal["bytes", "pins", "model"]

ROOM = 4096
"""Most bytes taken, and returned, in one step."""
_SEED = 1  # of the noise


class Simulator(Protocol):
    """A board and its side of the line.

    Attributes:
        clock: edges since power-on.
        backlog: bytes that wait or are in transmission.
    """

    clock: int
    backlog: int

    def step(self, data: bytes, clocks: int) -> bytes:
        """Takes at most `ROOM` bytes and runs at most `clocks` clocks; returns the output bytes.

        A transmission in progress may end the step earlier, when it is complete.
        """
        ...

    def set_baud(self, baud: int) -> None:
        """Sets the host's baud."""
        ...

    def power_cycle(self) -> None:
        """Restarts the board at clock 0."""
        ...

    def close(self) -> None:
        """Releases the simulator."""
        ...


def make_simulator(
    level: Level, geometry: Geometry, faults: Faults, device: Device | None = None
) -> Simulator:
    """The simulator of a board or of another device.

    The Verilog is compiled if it is not cached.

    Args:
        level: level of simulation.
        geometry: geometry of the build.
        faults: faults of the design and, at level "pins", of the line.
        device: another device, such as a conventional imager; None for the board.

    Raises:
        InputError: if the tools for the Verilog are missing.
    """
    if device is not None:
        return _Model(lambda: device.bus(geometry))
    if level == "model":
        from rtl_model.virtual.design_faults import FaultySystem

        return _Model(lambda: FaultySystem(geometry, faults, keep=False))
    return _Verilog(level, geometry, faults)


class _Model:
    """A cycle model behind its bridge, on a line that takes one clock for each byte.

    Args:
        make: returns the model after power-on.
    """

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
        """Does nothing: at byte level the line has no baud."""

    def close(self) -> None:
        """Does nothing."""


class _Verilog:
    """The Verilog in Verilator, with the shim of its level."""

    def __init__(self, level: Level, geometry: Geometry, faults: Faults) -> None:
        self._geometry, self._faults = geometry, faults
        self._library = _load(level, geometry, faults)
        self._out = ctypes.create_string_buffer(ROOM)
        self._clock, self._count = ctypes.c_uint64(), ctypes.c_uint64()
        self._received = self._sent = 0  # bytes in each direction, which index the noise
        self._baud = geometry.baud
        self._board: int | None = None
        self._masks = (np.zeros(ROOM, np.uint16), np.zeros(2 * ROOM, np.uint16))
        self._pointers = (self._masks[0].ctypes.data, self._masks[1].ctypes.data)
        self._masked = -2 * ROOM  # number of the byte of the first mask in the second array
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
            self._board, data, rx, len(data), clocks, self._out, tx, ROOM, self._clock, self._count
        )
        count = self._count.value
        self.clock = self._clock.value
        self._received += len(data)
        self._sent += count
        return self._out.raw[:count] if count else b""

    def _draw(self, count: int) -> int:
        """Draws the masks of the next bytes; returns the offset of the output masks, bytes."""
        share = self._faults.noise
        self._masks[0][:count] = noise(share, _SEED, "rx", self._received, count)
        if self._sent - self._masked > ROOM:
            self._masked = self._sent
            self._masks[1][:] = noise(share, _SEED, "tx", self._sent, 2 * ROOM)
        return (self._sent - self._masked) * self._masks[1].itemsize

    def set_baud(self, baud: int) -> None:
        self._baud = baud
        real = baud * (1 + self._faults.baud_error)
        self._library.viform_line(self._board, self._geometry.clock_hz / real)

    def close(self) -> None:
        if self._board is not None:
            self._library.viform_close(self._board)
        self._board = None


def faulty_library(top: str, shim: Path, geometry: Geometry, faults: Faults) -> ctypes.CDLL:
    """The library of a module and a shim, with the faults of the design (`verilated.library`)."""
    from rtl_model.verilated import VERILOG, build_crc, library
    from rtl_model.virtual.design_faults import inject_faults

    with tempfile.TemporaryDirectory() as text:
        sources = VERILOG
        if faults.of_design:
            sources = Path(text)
            inject_faults(VERILOG, sources, geometry, faults)
        build = build_crc(geometry, sources)
        path = library(top, geometry, shim, sources=sources, build=build)
    return ctypes.CDLL(str(path))


def _load(level: Level, geometry: Geometry, faults: Faults) -> ctypes.CDLL:
    name = "core" if level == "bytes" else "board"
    shim = Path(__file__).with_name(f"{name}.cpp")
    loaded = faulty_library(f"viform_{name}", shim, geometry, faults)
    pointer, number = ctypes.c_void_p, ctypes.c_uint64
    loaded.viform_open.restype = pointer
    loaded.viform_close.argtypes = [pointer]
    loaded.viform_line.argtypes = [pointer, ctypes.c_double]
    loaded.viform_step.argtypes = [
        pointer, ctypes.c_char_p, pointer, number, number, ctypes.c_char_p, pointer, number,
        ctypes.POINTER(number), ctypes.POINTER(number),
    ]  # fmt: skip
    return loaded
