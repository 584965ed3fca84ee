"""A virtual board: a simulator behind a pty, served by a thread.

While bytes are on the line, the simulation runs as fast as it can. So the baud determines how many
clocks a byte takes, not how long the host waits for it. After the last byte, the board's clock
follows the wall clock, as far as the simulator is fast enough, for `LINGER_S` of the board's time.
This covers the watchdog and any burst for which a host polls. After that the board idles: it runs
for a twentieth of the time, so that an unused board does not occupy a core.

At byte level the line has no duration and no baud. The watchdog counts clocks at every level.
"""

from __future__ import annotations

import select
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS
from rtl_model.registers.design import Device
from rtl_model.virtual.faults import Faults, parse
from rtl_model.virtual.line import Bytes, FaultyLine
from rtl_model.virtual.served import Pace, Served, measured_speed
from rtl_model.virtual.simulators import ROOM, Level, Simulator, make_simulator
from rtl_model.virtual.terminal import Terminal

LEVELS: tuple[Level, ...] = ("bytes", "pins", "model")

_CLOCK_HZ = {"bytes": 460_800, "model": 460_800, "pins": 3_686_400}
_BIT_CLOCKS = {"bytes": 4, "model": 4, "pins": 32}
_MOST_HZ = 8_000_000  # largest default clock

_BYTES_SLICE_S = 2e-3  # wall time of a step with bytes, after which the output is passed on
_PAUSE_S = 1e-3  # wait for a host that does not take its bytes
_RUN_ADDRESS = next(r.address for r in REGISTERS if r.name == "sensor_run")
_RUN = bytes([1, 1]) + (_RUN_ADDRESS // 4).to_bytes(4, "big") + (1).to_bytes(4, "big")
"""The request that starts the sensor."""
_PINS_BYTES = 64  # taken from the host at once
_QUEUE_BYTES = 1 << 20  # unread by the host; beyond it the oldest are lost, as in a driver


def nominal_clock(level: str, baud: int) -> int:
    """Default clock of a virtual board, Hz.

    The simulator reaches it, so that the watchdog's 100 ms are about 100 ms of the host. A faster
    line gets as many clocks a bit as 115 200 baud has, up to 8 MHz. At level "pins" these suffice
    to measure a baud.
    """
    return max(_CLOCK_HZ[level], min(_BIT_CLOCKS[level] * baud, _MOST_HZ))


class VirtualBoard(Served):
    """A board that is served at `port` from `start`, or the start of the context, to its end.

    Args:
        geometry: geometry of the build; the default one if None.
        level: "bytes" and "pins" run the Verilog, "model" the cycle model at byte level.
        faults: texts (see `virtual.faults`), or parsed ones.
        link: symbolic link to create for the port.
        device: another device to simulate instead, such as a conventional imager, at level
            "model"; `geometry` then gives its clock and baud.

    Attributes:
        speed: measured simulation speed, clocks of the board per second of wall time.
        clock: clocks simulated since the last power-on.

    Raises:
        InputError: for a fault that the level does not support, or if Verilator is missing.
    """

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        level: Level = "bytes",
        faults: Sequence[str] | Faults = (),
        link: Path | None = None,
        device: Device | None = None,
    ) -> None:
        super().__init__(Geometry() if geometry is None else geometry)
        self.level = level
        self.device = device
        self.faults = faults if isinstance(faults, Faults) else parse(faults, self.geometry)
        if level not in LEVELS:
            raise InputError("the board's level", ", ".join(LEVELS), repr(level), "choose one")
        if self.faults.of_pins and level != "pins":
            raise InputError(
                "a fault of baud or noise", "on a board of level pins", level, "add --level pins"
            )
        if device is not None and (level != "model" or self.faults.of_design):
            raise InputError(
                "a virtual imager", "of level model, with faults of its line only",
                f"of level {level}" if level != "model" else "with a fault of a design",
                "leave out --level, and faults such as stuck and foreign",
            )  # fmt: skip
        self._link = link

    @property
    def port(self) -> str:
        """Path that a host opens: the link, or the pty's slave."""
        return self._terminal.port

    def start(self) -> VirtualBoard:
        """Opens the port and serves it until `stop`."""
        simulator = make_simulator(self.level, self.geometry, self.faults, self.device)
        try:
            if self.level == "model" and self.device is None:
                # Compiled parts are loaded now, not when a host waits for the first frame.
                simulator.step(_RUN, 2 * self.geometry.tick_clocks)
            self.speed = measured_speed(simulator)
            simulator.power_cycle()
            self._terminal = Terminal(self.geometry.baud, self._link)
        except BaseException:
            simulator.close()
            raise
        self._serve(
            lambda waker: _Server(self, simulator, self._terminal, waker).turn,
            self._terminal.close,
            simulator.close,
        )
        return self


class _Server:
    """The thread's state. Each turn takes the bytes that have arrived and advances the clock."""

    def __init__(
        self, board: VirtualBoard, simulator: Simulator, terminal: Terminal, waker: int
    ) -> None:
        self._sim, self._terminal, self._waker = simulator, terminal, waker
        self._board, self._hz = board, board.geometry.clock_hz
        self._delay_s = board.faults.delay_s
        self._line = FaultyLine(board.faults)
        self._poll = select.poll()
        self._poll.register(terminal.master, select.POLLIN)
        self._poll.register(waker, select.POLLIN)
        self._queue: deque[tuple[float, bytes]] = deque()  # (when it is due, bytes)
        self._queue_bytes = 0
        # At level "pins", bytes are taken as slowly as they are sent, so that the host is slowed
        # too.
        self._share = _PINS_BYTES if board.level == "pins" else ROOM
        self._dead_until = 0  # clock until which the line carries nothing
        self._pace = Pace(self._hz, board.speed)
        self._whole = max(1, round(board.speed * _BYTES_SLICE_S))

    def turn(self) -> bool:
        """One step; returns whether there is another."""
        blocked = self._hand_over(time.monotonic())
        clocks, wait = (self._whole, 0.0) if self._sim.backlog else self._pace.plan(self._sim.clock)
        if blocked or self._queue:
            wait = min(wait, _PAUSE_S)
        data = b""
        for end, _ in self._poll.poll(wait * 1e3):
            if end == self._waker:
                return False
            if self._sim.backlog <= self._share:
                data = self._terminal.read(self._share)
                self._sim.set_baud(self._terminal.baud())
        if data:
            self._send_to_board(data)
        elif clocks:
            self._step(b"", clocks)
        self._board.speed, self._board.clock = self._pace.speed, self._sim.clock
        return True

    def _send_to_board(self, data: bytes) -> None:
        """Passes the host's bytes to the board, with the faults of the line."""
        for piece in self._line.carry("rx", data):
            if isinstance(piece, Bytes):
                if self._sim.clock >= self._dead_until:
                    for at in range(0, len(piece.data), ROOM):  # faults may have doubled bytes
                        self._step(piece.data[at : at + ROOM], self._whole)
            else:
                while self._sim.backlog:
                    self._step(b"", self._whole)
                self._cut_line(piece.seconds, piece.power_cycle)
        self._pace.note_traffic(self._sim.clock)

    def _cut_line(self, seconds: float, power_cycle: bool) -> None:
        if power_cycle:
            self._sim.power_cycle()
        self._dead_until = self._sim.clock + int(seconds * self._hz)
        self._pace.note_traffic(self._sim.clock)

    def _step(self, data: bytes, clocks: int) -> None:
        begun, first = time.monotonic(), self._sim.clock
        sent = self._sim.step(data, clocks)
        now = time.monotonic()
        if not data:
            self._pace.measure(self._sim.clock - first, now - begun)
        if not sent:
            return
        self._pace.note_traffic(self._sim.clock)
        for piece in self._line.carry("tx", sent):
            if not isinstance(piece, Bytes):
                self._cut_line(piece.seconds, piece.power_cycle)
            elif self._sim.clock >= self._dead_until:
                self._queue.append((now + self._delay_s, piece.data))
                self._queue_bytes += len(piece.data)
        self._hand_over(now)

    def _hand_over(self, now: float) -> bool:
        """Writes what is due to the host; returns whether the host does not take it."""
        while self._queue_bytes > _QUEUE_BYTES:
            self._queue_bytes -= len(self._queue.popleft()[1])
        while self._queue and self._queue[0][0] <= now:
            due, data = self._queue.popleft()
            taken = self._terminal.write(data)
            self._queue_bytes -= taken
            if taken < len(data):
                self._queue.appendleft((due, data[taken:]))
                return True
        return False
