"""A virtual board that answers to Etherbone over UDP, served by a thread.

While requests arrive, the simulation runs as fast as it can; each access takes a few clocks. Then
the board's clock follows the wall clock, as behind a serial line (`virtual.board`).
"""

from __future__ import annotations

import errno
import select
import socket
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host.ether import UdpAddress, resolved, udp_address
from rtl_model.registers import REGISTERS
from rtl_model.registers.design import Device
from rtl_model.virtual.ethernet.answers import answer
from rtl_model.virtual.ethernet.bus import Bus, make_bus
from rtl_model.virtual.faults import Faults, parse
from rtl_model.virtual.pace import Pace, measured_speed
from rtl_model.virtual.served import Served
from rtl_model.virtual.simulators import Level

_AT_ONCE = 64  # requests that are answered before the end of the board is looked for
_BUFFER = 1 << 21  # bytes asked of the system for each direction
_LONGEST = 65_536
_WAITING = 1024  # answers that a slow board holds; beyond it the oldest are lost
_RUN_ADDRESS = next(r.address for r in REGISTERS if r.name == "sensor_run")


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
        self.faults = faults if isinstance(faults, Faults) else parse(faults, self.geometry)
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
