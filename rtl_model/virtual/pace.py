"""When a virtual board's clock runs: with the wall clock after traffic, and rarely without any."""

from __future__ import annotations

import time
from typing import Protocol

LINGER_S = 0.3
"""Time in the board's time, s: three times its watchdog, longer than a cut line and a power
cycle."""
MARGIN = 2.0
"""Factor of a host's waiting times, for other work of the machine."""

_SLICE_S = 25e-6  # wall time of a step without bytes; a host's byte waits for half of it on average
_PAUSE_S = 1e-3  # wait when the board's clock has reached the wall clock
_REST_S, _RESTING_S = 0.1, 1e-3  # idle: steps of 1 ms, each after 0.1 s of sleep or a byte
_MEASURED_S = 30e-3  # of simulation, to measure its speed


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
