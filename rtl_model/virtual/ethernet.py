"""A virtual board that answers to Etherbone over UDP, served by a thread: Etherbone packets in
front of the bus of the cycle model or of the Verilog.

While requests arrive, the simulation runs as fast as it can; each access takes a few clocks. Then
the board's clock follows the wall clock, as behind a serial line (`virtual.board`).
"""

from __future__ import annotations

import ctypes
import errno
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host.ether import (
    Malformed,
    UdpAddress,
    Words,
    answer_packet,
    parse,
    probe_reply,
    resolved,
    udp_address,
)
from rtl_model.registers import REGISTERS
from rtl_model.registers.design import Device
from rtl_model.virtual import faults as said
from rtl_model.virtual.faults import Faults
from rtl_model.virtual.served import Pace, Served, measured_speed
from rtl_model.virtual.simulators import Level, faulty_library

if TYPE_CHECKING:
    from rtl_model.cycle import Behind

_ADDRESSES = 0xFFFFFFFC
_SHIM = Path(__file__).with_name("bus.cpp")
_AT_ONCE = 64  # requests that are answered before the end of the board is looked for
_BUFFER = 1 << 21  # bytes asked of the system for each direction
_LONGEST = 65_536
_WAITING = 1024  # answers that a slow board holds; beyond it the oldest are lost
_RUN_ADDRESS = next(r.address for r in REGISTERS if r.name == "sensor_run")


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


def answer(data: bytes, bus: Bus) -> bytes | None:
    """Performs a packet and returns its answer; None if it has none.

    Of each record the writes are performed before the reads. Bytes that are no Etherbone packet,
    and replies, are dropped.
    """
    try:
        packet = parse(data)
    except Malformed:
        return None
    if packet.reply:
        return None
    if packet.probe:
        return probe_reply(packet.rest)
    answers = []
    for record in packet.records:
        if record.written.size:
            bus.write(record.write_address, record.written.tobytes())
        if record.reads.size:
            answers.append((record.return_address, bus.read(record.reads)))
    return answer_packet(answers) if answers else None


class EthernetBoard(Served):
    """A board at a UDP address from `start`, or the start of the context, to its end.

    Args:
        url: `udp:HOST[:PORT]`; with port 0 the system chooses one.
        geometry: geometry of the build; the default one if None.
        level: "bytes" runs the Verilog, at its bus; "model" the cycle model.
        faults: texts (see `virtual.faults`), or parsed ones: silent, slow, and those of the design.
        device: another device to simulate instead, such as a conventional imager, at level
            "model".

    Raises:
        InputError: for an address that is not of this machine or in use, for a fault or a level of
            serial lines, or if Verilator is missing.
    """

    def __init__(
        self,
        url: str,
        geometry: Geometry | None = None,
        *,
        level: Level = "bytes",
        faults: Sequence[str] | Faults = (),
        device: Device | None = None,
    ) -> None:
        super().__init__(Geometry() if geometry is None else geometry)
        self.level, self.device = level, device
        self.faults = faults if isinstance(faults, Faults) else said.parse(faults, self.geometry)
        if self.faults.line or self.faults.of_pins or level == "pins":
            raise InputError(
                "a board over UDP", "of level bytes or model, with silent, slow, stuck or foreign",
                "one with level pins or faults of a serial line", "leave out --udp, or these",
            )  # fmt: skip
        if device is not None and (level != "model" or self.faults.of_design):
            raise InputError(
                "a virtual imager", "of level model, without a fault of a design",
                f"of level {level}" if level != "model" else "with one",
                "leave out --level, and faults such as stuck and foreign",
            )  # fmt: skip
        self._address = udp_address(url, least_port=0)

    @property
    def port(self) -> str:
        """Name that a host opens, `udp:HOST:PORT`."""
        return self._address.url

    def start(self) -> EthernetBoard:
        """Opens the socket and serves it until `stop`."""
        self._socket = _bound(self._address)
        self._address = self._address._replace(port=self._socket.getsockname()[1])
        try:
            bus = make_bus(self.level, self.geometry, self.faults, self.device)
            if self.level == "model" and self.device is None:
                # Compiled parts are loaded now, and the speed is that of a running sensor.
                bus.write(_RUN_ADDRESS, (1).to_bytes(4, "big"))
                bus.step(b"", 2 * self.geometry.tick_clocks)
            self.speed = measured_speed(bus)
            bus.power_cycle()
        except BaseException:
            self._socket.close()
            raise
        self._serve(
            lambda waker: _Server(self, bus, self._socket, waker).turn,
            self._socket.close,
            bus.close,
        )
        return self


class _Server:
    """The thread's state. Each turn answers the requests that have arrived, or runs clocks."""

    def __init__(self, board: EthernetBoard, bus: Bus, udp: socket.socket, waker: int) -> None:
        self._board, self._bus, self._socket, self._waker = board, bus, udp, waker
        self._silent, self._delay_s = board.faults.silent, board.faults.delay_s
        self._pace = Pace(board.geometry.clock_hz, board.speed)
        self._poll = select.poll()
        self._poll.register(udp, select.POLLIN)
        self._poll.register(waker, select.POLLIN)
        # (when it is due, answer, to)
        self._queue: deque[tuple[float, bytes, Any]] = deque(maxlen=_WAITING)

    def turn(self) -> bool:
        """One step; returns whether there is another."""
        self._hand_over()
        clocks, wait = self._pace.plan(self._bus.clock)
        if self._queue:
            wait = min(wait, 1e-3)
        arrived = False
        for end, _ in self._poll.poll(wait * 1e3):
            if end == self._waker:
                return False
            arrived = True
        if arrived:
            self._answer()
        elif clocks:
            begun, first = time.monotonic(), self._bus.clock
            self._bus.step(b"", clocks)
            self._pace.measure(self._bus.clock - first, time.monotonic() - begun)
        self._board.speed, self._board.clock = self._pace.speed, self._bus.clock
        return True

    def _answer(self) -> None:
        for _ in range(_AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(_LONGEST)
            except BlockingIOError:
                break
            except OSError:  # an earlier answer was refused
                continue
            reply = answer(data, self._bus)
            if reply is None or self._silent:
                continue
            if self._delay_s:
                self._queue.append((time.monotonic() + self._delay_s, reply, sender))
            else:
                self._send(reply, sender)
        self._pace.note_traffic(self._bus.clock)

    def _hand_over(self) -> None:
        while self._queue and self._queue[0][0] <= time.monotonic():
            _, reply, sender = self._queue.popleft()
            self._send(reply, sender)

    def _send(self, reply: bytes, sender: Any) -> None:
        try:
            self._socket.sendto(reply, sender)
        except OSError:
            return  # a full buffer, or a host that is gone: the answer is lost


def _bound(address: UdpAddress) -> socket.socket:
    """A socket at the address. Raises InputError if it is in use, or not of this machine."""
    family, place = resolved(address)
    udp = socket.socket(family, socket.SOCK_DGRAM)
    try:
        for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
            udp.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
        udp.bind(place)
        udp.setblocking(False)
    except OSError as exc:
        udp.close()
        if exc.errno == errno.EADDRINUSE:
            raise InputError(
                f"{address.url}", "a UDP port that is free", "one that is in use",
                "end the program that uses it, or name another port",
            ) from exc  # fmt: skip
        raise InputError(
            f"{address.url}", "an address of this machine", f"refused ({exc.strerror})",
            "take udp:127.0.0.1, or an address that `ip address` lists",
        ) from exc  # fmt: skip
    return udp
