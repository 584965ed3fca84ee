"""A simulated board that a thread serves, from start to stop. Its clock runs with the wall clock
after traffic, and rarely without any.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self

from cosim import ViformError
from rtl_model.geometry import Geometry

LINGER_S = 0.3
"""Time in the board's time, s: three times its watchdog, longer than a cut line and a power
cycle."""
MARGIN = 2.0
"""Factor of a host's waiting times, for other work of the machine."""
_SLICE_S = 25e-6  # wall time of a step without bytes; a host's byte waits for half of it on average
_PAUSE_S = 1e-3  # wait when the board's clock has reached the wall clock
_REST_S, _RESTING_S = 0.1, 1e-3  # idle: steps of 1 ms, each after 0.1 s of sleep or a byte
_MEASURED_S = 30e-3  # of simulation, to measure its speed
_ATTENTION_S = 0.2  # interval at which `wait` checks the thread


class Served:
    """Start, end and failure of the thread. A subclass opens its port and gives the turns.

    Attributes:
        geometry: geometry of the build.
        speed: measured simulation speed, clocks of the board per second of wall time.
        clock: clocks simulated since the last power-on.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.speed = float(geometry.clock_hz)
        self.clock = 0
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._close: Callable[[], None] = lambda: None

    @property
    def port(self) -> str:
        """Name that a host opens."""
        raise NotImplementedError

    @property
    def clocks_per_second(self) -> float:
        """Clocks of the board per second of wall time, at most its nominal clock."""
        return min(self.speed, float(self.geometry.clock_hz))

    @property
    def time_scale(self) -> float:
        """Factor by which a host should lengthen its waiting times.

        It is the ratio of nominal to measured clock with a margin for a busy machine, at least 1.
        """
        return max(1.0, MARGIN * self.geometry.clock_hz / self.speed)

    @property
    def alive(self) -> bool:
        """Whether the board is being served."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> Self:
        """Opens the port and serves it until `stop`."""
        raise NotImplementedError

    def wait(self, ended: threading.Event) -> None:
        """Waits until the event is set, or the board ends by itself, which is a failure."""
        while self.alive and not ended.wait(_ATTENTION_S):
            pass

    def stop(self) -> None:
        """Ends the board and closes the port. Raises ViformError if the board has failed."""
        if self._thread is None:
            return
        os.write(self._wake, b"x")
        self._thread.join()
        self._thread = None
        os.close(self._wake)
        os.close(self._waker)
        self._close()
        if self._failure is not None:
            raise ViformError("the virtual board ended early") from self._failure

    def __enter__(self) -> Self:
        try:
            return self.start()
        except BaseException:
            if self.alive:
                self.stop()
            raise

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _serve(
        self,
        server: Callable[[int], Callable[[], bool]],
        close_port: Callable[[], None],
        close_simulator: Callable[[], None],
    ) -> None:
        """Starts the thread.

        Args:
            server: returns the function of one turn, which tells whether another follows. Its
                argument is a file that becomes readable when the board must end.
            close_port: called when the thread has ended, or cannot begin.
            close_simulator: called by the thread at its end.
        """
        self._close = close_port
        try:
            self._waker, self._wake = os.pipe()
            self._thread = threading.Thread(
                target=self._run, args=(server, close_simulator), daemon=True
            )
            self._thread.start()
        except BaseException:  # such as a request to end
            close_port()
            raise

    def _run(
        self, server: Callable[[int], Callable[[], bool]], close_simulator: Callable[[], None]
    ) -> None:
        try:
            turn = server(self._waker)
            while turn():
                pass
        except BaseException as exc:  # `stop` raises it
            self._failure = exc
        finally:
            close_simulator()


class Stepped(Protocol):
    """A simulator that runs clocks."""

    @property
    def clock(self) -> int:
        """Edges since power-on."""

    def step(self, data: bytes, clocks: int) -> bytes:
        """Runs at most `clocks` clocks."""


class Pace:
    """The clocks to run, and the measured speed of the simulation.

    Attributes:
        speed: clocks per second of wall time.
        slice: clocks of a step that a host's request may wait for.
    """

    def __init__(self, clock_hz: int, speed: float) -> None:
        self._hz, self.speed = clock_hz, speed
        self.slice = max(1, round(speed * _SLICE_S))
        self._ran, self._spent = 0, 0.0  # clocks and seconds since the last measurement of speed
        self.note_traffic(0)

    def note_traffic(self, clock: int) -> None:
        """Notes that something arrived or was sent, at this clock of the board."""
        self._since, self._since_clock = time.monotonic(), clock

    def plan(self, clock: int) -> tuple[int, float]:
        """Clocks to run at this clock if nothing arrives, and the time to wait before, s."""
        behind = int((time.monotonic() - self._since) * self._hz) - (clock - self._since_clock)
        if clock - self._since_clock >= LINGER_S * self._hz:
            return max(0, min(behind, round(self.speed * _RESTING_S))), _REST_S
        if behind <= 0:
            return 0, _PAUSE_S
        return min(behind, self.slice), 0.0

    def measure(self, clocks: int, seconds: float) -> None:
        """Takes the wall time of a step without traffic into account."""
        if clocks < self.slice:  # a shorter step is mostly overhead
            return
        self._ran += clocks
        self._spent += seconds
        if self._spent >= _MEASURED_S:
            self.speed = self._ran / self._spent
            self._ran, self._spent = 0, 0.0


def measured_speed(simulator: Stepped) -> float:
    """Measures the clocks per second of a board without traffic."""
    simulator.step(b"", 1)  # compiles the cycle model if necessary
    clocks, begun = 256, time.perf_counter()
    while True:
        simulator.step(b"", clocks)
        spent = time.perf_counter() - begun
        if spent >= _MEASURED_S or simulator.clock > 1 << 40:
            break
        clocks *= 2
    for _ in range(2):  # the best of three, because other work may have slowed some
        begun = time.perf_counter()
        simulator.step(b"", clocks)
        spent = min(spent, time.perf_counter() - begun)
    return clocks / spent
