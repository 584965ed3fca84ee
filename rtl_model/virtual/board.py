"""A virtual board: a simulated one behind a pty, served by a thread.

Time. While bytes are on the line the simulation runs as fast as it can; so a baud says how many
clocks a byte takes, not how long a host waits for it. Between them the board's clock goes on with
the wall clock, as far as the simulator keeps up: for `LINGER_S` of the board's time after the last
byte, which covers its watchdog, and any burst that a host polls for. After that the board rests: it
runs for a twentieth of the time, so that one left alone takes no core.

A byte-level line has no duration and knows no baud. Its watchdog counts the clocks that pass.
"""

from __future__ import annotations

import os
import select
import threading
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from cosim import InputError, ViformError
from rtl_model.geometry import Geometry
from rtl_model.virtual.faults import Faults, parse
from rtl_model.virtual.line import Bytes, FaultyLine
from rtl_model.virtual.simulators import ROOM, Level, Simulator, make_simulator
from rtl_model.virtual.terminal import Terminal

__all__ = ["LEVELS", "LINGER_S", "VirtualBoard", "nominal_clock"]

LEVELS: tuple[Level, ...] = ("bytes", "pins", "model")

LINGER_S = 0.3
"""Of the board's own time: three times its watchdog, longer than a cut line and a power cycle."""

_CLOCK_HZ = {"bytes": 460_800, "model": 460_800, "pins": 3_686_400}
_BIT_CLOCKS = {"bytes": 4, "model": 4, "pins": 32}
_MOST_HZ = 8_000_000  # asked of no simulator

_SLICE_S = 25e-6  # wall time of a step without bytes: a host's byte waits half of that
_BYTES_SLICE_S = 2e-3  # with bytes: so often, what has come out is handed on
_PAUSE_S = 1e-3  # where the board's clock has caught up with the wall's
_REST_S, _RESTING_S = 0.1, 1e-3  # at rest: a step of 1 ms, then 0.1 s of sleep, or till bytes come
_MEASURED_S = 30e-3  # of simulation, to know its speed
_MARGIN = 2.0  # of time_scale: the machine may have other work
_PINS_BYTES = 64  # taken from the host at once
_ATTENTION_S = 0.2  # between two looks at whether the board still lives
_HELD_BYTES = 1 << 20  # that a host does not read; then the oldest are lost, as in a driver


def nominal_clock(level: str, baud: int) -> int:
    """Hz of a virtual board whose clock nobody has named: what the simulator keeps up with, so that
    its watchdog's 100 ms are about 100 ms of the host's. A faster line gets as many clocks a bit as
    115 200 baud has, up to 8 MHz; with pins these are enough to tell a baud by."""
    return max(_CLOCK_HZ[level], min(_BIT_CLOCKS[level] * baud, _MOST_HZ))


class VirtualBoard:
    """A board at `port`, from `start` or the context's begin to its end.

    geometry: of the build; None is the table's own.
    level: "bytes" or "pins" run the Verilog, "model" the cycle model, at byte level.
    faults: texts as `virtual.faults` explains, or parsed.
    link: symlink to the port.
    imager: kind of a conventional imager that stands in the board's place, at level "model";
        geometry then says its clock and baud.

    Attributes:
        speed: clocks that a second of simulation holds, nominal or more or less.
        clock: of the board, as far as it has been simulated; from 0 again after a loss of power.

    Raises InputError for a fault that the level cannot have, and where Verilator is missing.
    """

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        level: Level = "bytes",
        faults: Sequence[str] | Faults = (),
        link: Path | None = None,
        imager: str | None = None,
    ) -> None:
        self.geometry = Geometry() if geometry is None else geometry
        self.level = level
        self.imager = imager
        self.faults = faults if isinstance(faults, Faults) else parse(faults, self.geometry)
        if level not in LEVELS:
            raise InputError("the board's level", ", ".join(LEVELS), repr(level), "choose one")
        if self.faults.of_pins and level != "pins":
            raise InputError(
                "a fault of baud or noise", "on a board of level pins", level, "add --level pins"
            )
        if imager is not None and (level != "model" or self.faults.of_design):
            raise InputError(
                "a virtual imager", "of level model, with faults of its line alone",
                f"of level {level}" if level != "model" else "with a fault of a design",
                "leave out --level, and faults such as stuck and foreign",
            )  # fmt: skip
        self._link = link
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self.speed = float(self.geometry.clock_hz)
        self.clock = 0

    @property
    def port(self) -> str:
        """What a host opens: the link, or the pty's slave."""
        return self._terminal.port

    @property
    def clocks_per_second(self) -> float:
        """Clocks of the board that a second of the wall clock holds while the simulation runs, at
        most the board's nominal clock."""
        return min(self.speed, float(self.geometry.clock_hz))

    @property
    def time_scale(self) -> float:
        """By what a host should lengthen every time it waits: how much slower than nominal the
        board may run, with a margin for a busy machine; 1 where it keeps up easily."""
        return max(1.0, _MARGIN * self.geometry.clock_hz / self.speed)

    @property
    def alive(self) -> bool:
        """Whether the board is being served."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> VirtualBoard:
        """Opens the port and serves it until `stop`."""
        simulator = make_simulator(self.level, self.geometry, self.faults, self.imager)
        try:
            self.speed = _measure(simulator)
            simulator.power_cycle()
            self._terminal = Terminal(self.geometry.baud, self._link)
        except BaseException:
            simulator.close()
            raise
        self._waker, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._run, args=(simulator,), daemon=True)
        self._thread.start()
        return self

    def wait(self) -> None:
        """Returns when the board has ended by itself, which is a failure; Ctrl-C comes through."""
        while self.alive:
            time.sleep(_ATTENTION_S)

    def stop(self) -> None:
        """Ends the board and closes the port. Raises ViformError where it had failed."""
        if self._thread is None:
            return
        os.write(self._wake, b"x")
        self._thread.join()
        self._thread = None
        os.close(self._wake)
        os.close(self._waker)
        self._terminal.close()
        if self._failure is not None:
            raise ViformError("the virtual board ended early") from self._failure

    def __enter__(self) -> VirtualBoard:
        return self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _run(self, simulator: Simulator) -> None:
        try:
            server = _Server(self, simulator, self._terminal, self._waker)
            while server.turn():
                self.speed, self.clock = server.speed, simulator.clock
        except BaseException as exc:  # handed to whoever stops the board
            self._failure = exc
        finally:
            simulator.close()


class _Server:
    """The thread's state: turn after turn, it takes what has come and lets time pass."""

    def __init__(
        self, board: VirtualBoard, simulator: Simulator, terminal: Terminal, waker: int
    ) -> None:
        self._sim, self._terminal, self._waker = simulator, terminal, waker
        self._hz = board.geometry.clock_hz
        self._late_s = board.faults.late_s
        self._line = FaultyLine(board.faults)
        self._poll = select.poll()
        self._poll.register(terminal.master, select.POLLIN)
        self._poll.register(waker, select.POLLIN)
        self._held: deque[tuple[float, bytes]] = deque()  # (when it is due, bytes)
        self._held_bytes = 0
        # A line that takes its time takes bytes as they go out, so that the host feels it.
        self._share = _PINS_BYTES if board.level == "pins" else ROOM
        self._dead_until = 0  # clock; before it the line carries nothing
        self.speed = board.speed
        self._slice = max(1, round(self.speed * _SLICE_S))
        self._whole = max(1, round(self.speed * _BYTES_SLICE_S))
        self._ran, self._spent = 0, 0.0  # since the speed was last worked out
        self._traffic(time.monotonic())

    def turn(self) -> bool:
        """One step; returns whether there is another."""
        now = time.monotonic()
        blocked = self._hand_over(now)
        clocks, wait = self._plan(now)
        if blocked or self._held:
            wait = min(wait, _PAUSE_S)
        data = b""
        for end, _ in self._poll.poll(wait * 1e3):
            if end == self._waker:
                return False
            if self._sim.backlog <= self._share:
                data = self._terminal.read(self._share)
                self._sim.set_baud(self._terminal.baud())
        if data:
            self._give(data)
        elif clocks:
            self._step(b"", clocks)
        return True

    def _plan(self, now: float) -> tuple[int, float]:
        """Returns (clocks to run unless bytes come, seconds to wait for them first)."""
        if self._sim.backlog:
            return self._whole, 0.0
        behind = int((now - self._since) * self._hz) - (self._sim.clock - self._since_clock)
        if self._sim.clock - self._since_clock >= LINGER_S * self._hz:
            return max(0, min(behind, round(self.speed * _RESTING_S))), _REST_S
        if behind <= 0:
            return 0, _PAUSE_S
        return min(behind, self._slice), 0.0

    def _traffic(self, now: float) -> None:
        self._since, self._since_clock = now, self._sim.clock

    def _give(self, data: bytes) -> None:
        """Gives the host's bytes to the board, and whatever befalls the line with them."""
        for piece in self._line.carry("rx", data):
            if isinstance(piece, Bytes):
                if self._sim.clock >= self._dead_until:
                    for at in range(0, len(piece.data), ROOM):  # doubled bytes are more
                        self._step(piece.data[at : at + ROOM], self._whole)
            else:
                while self._sim.backlog:
                    self._step(b"", self._whole)
                self._die(piece.seconds, piece.power_cycle)
        self._traffic(time.monotonic())

    def _die(self, seconds: float, power_cycle: bool) -> None:
        if power_cycle:
            self._sim.power_cycle()
        self._dead_until = self._sim.clock + int(seconds * self._hz)
        self._traffic(time.monotonic())

    def _step(self, data: bytes, clocks: int) -> None:
        begun, first = time.monotonic(), self._sim.clock
        sent = self._sim.step(data, clocks)
        now = time.monotonic()
        if (
            not data and clocks >= self._slice
        ):  # not one cut short by the wall clock, mostly overhead
            self._ran += self._sim.clock - first
            self._spent += now - begun
            if self._spent >= _MEASURED_S:
                self.speed = self._ran / self._spent
                self._ran, self._spent = 0, 0.0
        if not sent:
            return
        self._traffic(now)
        for piece in self._line.carry("tx", sent):
            if not isinstance(piece, Bytes):
                self._die(piece.seconds, piece.power_cycle)
            elif self._sim.clock >= self._dead_until:
                self._held.append((now + self._late_s, piece.data))
                self._held_bytes += len(piece.data)
        self._hand_over(now)

    def _hand_over(self, now: float) -> bool:
        """Writes what is due to the host; returns whether the host does not take it."""
        while self._held_bytes > _HELD_BYTES:
            self._held_bytes -= len(self._held.popleft()[1])
        while self._held and self._held[0][0] <= now:
            due, data = self._held.popleft()
            taken = self._terminal.write(data)
            self._held_bytes -= taken
            if taken < len(data):
                self._held.appendleft((due, data[taken:]))
                return True
        return False


def _measure(simulator: Simulator) -> float:
    """Returns clocks per second of a board on whose line nothing happens."""
    simulator.step(b"", 1)  # compiles the cycle model where that was not done before
    clocks, begun = 256, time.perf_counter()
    while True:
        simulator.step(b"", clocks)
        spent = time.perf_counter() - begun
        if spent >= _MEASURED_S or simulator.clock > 1 << 40:
            break
        clocks *= 2
    for _ in range(2):  # the best of three: a busy machine took some of the time
        begun = time.perf_counter()
        simulator.step(b"", clocks)
        spent = min(spent, time.perf_counter() - begun)
    return clocks / spent
