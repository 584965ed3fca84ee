"""Detects a restart of the board by its uptime. A restart explains all other faults of a stage."""

from __future__ import annotations

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.deadline import OutOfTime
from rtl_model.bringup.bench.stage import StageFault
from rtl_model.host import LineFault

_FAST = 1.5  # largest ratio of a real clock to its nominal frequency
_WRAP = 1 << 32  # clocks


class Uptime:
    """The board's uptime at the start of a stage."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._before = self._read()

    def restarted(self) -> StageFault | None:
        """The fault "restarted" if the uptime has fallen and cannot have overflowed, else None."""
        now = self._read()
        if self._before is None or now is None:
            return None
        (first, begun), (last, ended) = self._before, now
        hz = self._clock_hz()
        if hz is None:
            return None
        most = first + _FAST * (ended - begun) * hz
        if last >= first or most >= _WRAP:
            return None
        again = self._read()
        if again is None or again[0] >= first or last > _FAST * (ended - begun) * hz:
            return None  # one of the readings was wrong: no restart within the stage
        return StageFault(
            "restarted",
            f"the board restarted within the stage: ctrl_uptime fell from {first} to {last}",
            "check its supply and its reset",
            {"uptime_before": first, "uptime_after": last},
        )

    def _read(self) -> tuple[int, float] | None:
        try:
            return self._bench.read("ctrl_uptime"), self._bench.port.now()
        except (LineFault, OutOfTime):
            return None

    def _clock_hz(self) -> int | None:
        """Nominal clock, Hz; read from the board if the identity stage has not passed."""
        if self._bench.board:
            return self._bench.geometry.clock_hz
        try:
            return self._bench.read_stable("ctrl_clock_hz")
        except (LineFault, OutOfTime):
            return None
