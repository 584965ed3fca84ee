"""A simulated board's bus behind Etherbone: the cycle model, or the Verilog at AXI-Lite."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rtl_model.geometry import Geometry
from rtl_model.host.ether import Words
from rtl_model.registers.design import Device
from rtl_model.virtual.faults import Faults
from rtl_model.virtual.simulators import Level, faulty_library

if TYPE_CHECKING:
    from rtl_model.cycle import Behind

_ADDRESSES = 0xFFFFFFFC
_SHIM = Path(__file__).with_name("bus.cpp")


class Bus(Protocol):
    """A board at its bus."""

    @property
    def clock(self) -> int:
        """Edges since power-on."""
        ...

    def read(self, addresses: Words) -> bytes:
        """The words at byte addresses, in that order, big-endian."""
        ...

    def write(self, address: int, words: bytes) -> None:
        """Writes words (big-endian) to consecutive byte addresses."""
        ...

    def step(self, data: bytes, clocks: int) -> bytes:
        """Runs `clocks` clocks. `data` must be empty; returns nothing."""
        ...

    def power_cycle(self) -> None:
        """Restarts the board at clock 0."""
        ...

    def close(self) -> None:
        """Releases the simulator."""
        ...


def make_bus(level: Level, geometry: Geometry, faults: Faults, device: Device | None = None) -> Bus:
    """The bus of a board or of another device; arguments and errors as `make_simulator`."""
    if device is not None:
        return _ModelBus(lambda: device.bus(geometry))
    if level == "model":
        from rtl_model.virtual.design_faults import FaultySystem

        return _ModelBus(lambda: FaultySystem(geometry, faults, keep=False))
    return _VerilogBus(geometry, faults)


class _ModelBus:
    """The cycle model of a board, or another device's registers.

    Args:
        make: returns the model after power-on.
    """

    def __init__(self, make: Callable[[], Behind]) -> None:
        self._make = make
        self.power_cycle()

    def power_cycle(self) -> None:
        self._system = self._make()
        self._blocks = (
            getattr(self._system, "read_block", None),
            getattr(self._system, "write_block", None),
        )

    @property
    def clock(self) -> int:
        return self._system.clock

    def read(self, addresses: Words) -> bytes:
        first, count = int(addresses[0]), addresses.size
        block = self._blocks[0]
        if block is not None and count > 1 and _consecutive(addresses):
            data: bytes | None = block(first & _ADDRESSES, count)
            if data is not None:
                return data
        read = self._system.read
        return b"".join(
            read(address & _ADDRESSES).to_bytes(4, "big") for address in addresses.tolist()
        )

    def write(self, address: int, words: bytes) -> None:
        system, address = self._system, address & _ADDRESSES
        system.line.count_words(words)
        block = self._blocks[1]
        if block is not None and len(words) > 4 and block(address, words):
            return
        for at in range(0, len(words), 4):
            system.write((address + at) & 0xFFFFFFFF, int.from_bytes(words[at : at + 4], "big"))

    def step(self, data: bytes, clocks: int) -> bytes:
        self._system.advance(self._system.clock + clocks)
        return b""

    def close(self) -> None:
        """Does nothing."""


def _consecutive(addresses: Words) -> bool:
    native = addresses.astype(np.uint32)
    return bool((native[1:] - native[:-1] == 4).all())


class _VerilogBus:
    """`viform_ethernet` in Verilator, accessed as LiteEth's AXI-Lite master does."""

    def __init__(self, geometry: Geometry, faults: Faults) -> None:
        self._library = faulty_library("viform_ethernet", _SHIM, geometry, faults)
        pointer, number = ctypes.c_void_p, ctypes.c_uint64
        self._library.viform_open.restype = pointer
        self._library.viform_close.argtypes = [pointer]
        self._library.viform_run.argtypes = [pointer, number]
        self._library.viform_run.restype = number
        for name in ("viform_read", "viform_write"):
            access = getattr(self._library, name)
            access.argtypes, access.restype = [pointer, number, pointer, pointer], number
        self._board: int | None = None
        self.power_cycle()

    def power_cycle(self) -> None:
        self.close()
        self._board = self._library.viform_open()
        self.clock = 0

    def read(self, addresses: Words) -> bytes:
        native = addresses.astype(np.uint32)
        values = np.empty_like(native)
        self.clock = self._library.viform_read(
            self._board, native.size, native.ctypes.data, values.ctypes.data
        )
        return values.astype(">u4").tobytes()

    def write(self, address: int, words: bytes) -> None:
        values = np.frombuffer(words, ">u4").astype(np.uint32)
        addresses = (address + 4 * np.arange(values.size, dtype=np.uint64)).astype(np.uint32)
        self.clock = self._library.viform_write(
            self._board, values.size, addresses.ctypes.data, values.ctypes.data
        )

    def step(self, data: bytes, clocks: int) -> bytes:
        self.clock = self._library.viform_run(self._board, clocks)
        return b""

    def close(self) -> None:
        if self._board is not None:
            self._library.viform_close(self._board)
        self._board = None
