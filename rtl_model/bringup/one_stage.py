"""Runs one stage of the bring-up within a time limit, and examines the line meanwhile.

A restart of the board is detected by its uptime, and explains all other faults of a stage.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from cosim import InputError
from rtl_model.bringup.bench.bench import Bench, SerialBench
from rtl_model.bringup.bench.deadline import OutOfTime
from rtl_model.bringup.bench.evidence import Evidence
from rtl_model.bringup.bench.monitor import LineMonitor
from rtl_model.bringup.bench.stage import Figures, Report, Stage, StageFault
from rtl_model.bringup.bench.translation import find_translation
from rtl_model.host import Cause, LineFault, Lines
from rtl_model.host.csr import CsrMap
from rtl_model.host.ports import AS_EVER
from rtl_model.registers import MAGIC

_FAST = 1.5  # largest ratio of a real clock to its nominal frequency
_WRAP = 1 << 32  # clocks
_EXTRA_S = 5.0  # after a stage has failed, to examine the line
_KINDS_OF_DESIGN = {  # kinds of faults that a faulty line causes as well
    "stuck-bit", "alias", "memory", "reset", "restore", "scratch", "rate", "stands-still", "rows",
    "tick", "clock",
}  # fmt: skip


@dataclass(frozen=True)
class BringUp:
    """Options of a bring-up.

    Attributes:
        baud: baud of the line.
        csr: registers of the loaded design; None for the Viform board's.
        stop_at_first: whether the stages after a failed one are left out. They always are after a
            failure of the port, bytes or identity stage.
        simulated: whether there is no real clock behind the port; None: true for a pty only.
        time_scale: seconds of the host's time to a second of the board's clock.
        frames: number of frames in a captured burst.
        low_latency: whether the driver of the port is asked for its low-latency mode. The figures
            of the port stage state whether it was granted.
        lines: modem lines of the port to set.
        log: file that every transaction is written to, None for none.
        allowed_s: time limit of each stage, s, which replaces `ALLOWED_S`.
    """

    baud: int = 115_200
    csr: CsrMap | None = None
    stop_at_first: bool = True
    simulated: bool | None = None
    time_scale: float = 1.0
    frames: int = 8
    low_latency: bool = False
    lines: Lines = AS_EVER
    log: Path | None = None
    allowed_s: float | None = None


def run_stage(
    name: str, check: Callable[[SerialBench], Figures], bench: SerialBench, allowed: float
) -> Stage:
    """Runs the check of a stage. The outcome records every fault of the board or the line.

    Args:
        name: name of the stage.
        check: returns the figures of a stage that has passed.
        bench: the board under test.
        allowed: time limit, s.
    """
    clock = bench.port.inner.now  # not limited by the deadline
    begin = clock()
    bench.port.allow(allowed)
    retried, strays = bench.bone.retried, bench.bone.strays

    def spent() -> float:
        return clock() - begin

    uptime: Uptime | None = None
    try:
        if bench.monitor is None and bench.csr.is_viform_board and bench.magic == MAGIC:
            bench.monitor = LineMonitor(bench.bone, bench.csr)
            bench.monitor.begin()
        uptime = None if bench.monitor is None else Uptime(bench)
        figures = check(bench)
        if bench.monitor is not None and bench.board:
            bench.monitor.geometry = bench.geometry
        evidence = _take_evidence(bench, bench.bone.retried - retried)
    except (LineFault, StageFault) as fault:
        _allow_more(bench)  # its time limit may have passed
        translated = None if bench.monitor is None else find_translation(bench)
        if translated is not None:
            return failed_stage(name, spent(), _because(translated, fault))
        _allow_more(bench)
        restart = None if uptime is None else uptime.restarted()
        after = None if restart else _evidence_of_failure(bench, bench.bone.retried - retried)
        restart = restart or _restarted(None, after)
        return failed_stage(name, spent(), restart or _answered_before(fault, bench), after)
    except OutOfTime:
        repeats = bench.bone.retried - retried
        cause, figures = _out_of_time(name, bench, allowed)
        stage = Stage(name, "failed", cause, figures, spent(), "out-of-time")
        _settle(bench, repeats)
        return stage
    except InputError as fault:  # the board states a value that is not allowed
        return Stage(name, "failed", str(fault), {}, spent(), "cannot-be")
    retried, strays = bench.bone.retried - retried, bench.bone.strays - strays
    if not (retried or strays or (evidence is not None and not evidence.clean)):
        return Stage(name, "ok", None, figures, spent())
    restart = _restarted(uptime, evidence)
    if restart is not None:
        return failed_stage(name, spent(), restart)
    _allow_more(bench)
    translated = find_translation(bench)
    if translated is not None:
        return failed_stage(name, spent(), translated)
    figures = figures | {"reads_repeated": retried, "stray_bytes": strays}
    cause, figures = _line_fault(evidence, figures)
    return Stage(name, "failed", cause, figures, spent(), "spoilt")


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


def stop_sensor(bench: Bench, report: Report) -> None:
    """Stops the sensor of a Viform board, if the line works."""
    if any(stage.name == "identity" and stage.outcome == "ok" for stage in report.stages):
        try:
            bench.write("sensor_run", 0)
        except (LineFault, OutOfTime) as fault:
            if isinstance(fault, LineFault) and fault.cause is Cause.DIFFERS:
                raise


def _allow_more(bench: SerialBench) -> None:
    """Allows time to examine the line after a stage."""
    bench.port.allow(_EXTRA_S * max(1.0, bench.bone.time_scale))


def _because(cause: StageFault, observed: LineFault | StageFault) -> StageFault:
    """The cause, with the observation that it explains."""
    figures = observed.figures if isinstance(observed, StageFault) else {}
    return StageFault(cause.kind, f"{cause.text} (seen as: {observed.text})", cause.remedy, figures)


def _answered_before(fault: LineFault | StageFault, bench: SerialBench) -> LineFault | StageFault:
    """The fault; a silent board that answered in an earlier stage has wires that are right."""
    if bench.magic is None or not isinstance(fault, LineFault) or fault.cause is not Cause.SILENT:
        return fault
    return LineFault(
        fault.cause,
        f"{fault.text}, though the board answered before",
        "check its supply and its reset, and the cable",
    )


def failed_stage(
    name: str, seconds: float, fault: LineFault | StageFault, evidence: Evidence | None = None
) -> Stage:
    """A failed stage. Faults of the line are added to the cause; they replace a cause that would
    otherwise be the design's.

    Args:
        name: name of the stage.
        seconds: duration, s.
        fault: the fault that ended it.
        evidence: errors of the line during the stage, None if unknown.
    """
    if isinstance(fault, StageFault):
        kind, figures = fault.kind, fault.figures
    else:
        kind, figures = fault.cause.value, {}
    if evidence is None or not evidence.known or evidence.clean:
        return Stage(name, "failed", str(fault), figures, seconds, kind)
    figures = figures | {"line": evidence.figures}
    if kind in _KINDS_OF_DESIGN:
        cause = f"{evidence.text}, so the following observation proves nothing: {fault.text}"
        return Stage(name, "failed", f"{cause}; {evidence.remedy}", figures, seconds, "spoilt")
    return Stage(name, "failed", f"{fault}; meanwhile {evidence.text}", figures, seconds, kind)


def _out_of_time(name: str, bench: SerialBench, allowed: float) -> tuple[str, Figures]:
    """Cause and figures of a stage that exceeded its time."""
    bone = bench.bone
    return (
        f"stage {name} was not done within {allowed:g} s, after {bone.round_trips} round trips and "
        f"{bone.retried} repeats; check the line, or give a slower board more time with "
        "--time-scale",
        {"round_trips": bone.round_trips, "retried": bone.retried},
    )


def _settle(bench: SerialBench, repeats: int) -> None:
    """Discards an answer in transmission at the deadline, and restarts the monitor's counts."""
    _allow_more(bench)
    with suppress(LineFault, OutOfTime):
        bench.bone.resynchronise()
        _take_evidence(bench, repeats)


def _restarted(uptime: Uptime | None, evidence: Evidence | None) -> StageFault | None:
    """The fault "restarted".

    The uptime shows a restart; so do the line's counters if the board had been running for so
    short a time that its uptime has already passed the earlier value.
    """
    fault = None if uptime is None else uptime.restarted()
    if fault is None and evidence is not None and evidence.restarted:
        return StageFault(
            "restarted",
            "the board restarted: its counters of the line began at 0 again",
            "check its supply and its reset",
        )
    return fault


def _take_evidence(bench: SerialBench, repeats: int) -> Evidence | None:
    return None if bench.monitor is None else bench.monitor.take_evidence(repeats)


def _evidence_of_failure(bench: SerialBench, repeats: int) -> Evidence | None:
    """Evidence after a failed stage; None if the counters cannot be read."""
    try:
        return _take_evidence(bench, repeats)
    except (LineFault, OutOfTime):
        return None


def _line_fault(evidence: Evidence | None, figures: Figures) -> tuple[str, Figures]:
    """Cause and figures of a stage that passed although the line lost, added or changed bytes."""
    repeated, strays = figures.get("reads_repeated", 0), figures.get("stray_bytes", 0)
    counts = (
        f"{repeated} read{'s' * (repeated != 1)} had to be repeated and {strays} "
        f"byte{'s' * (strays != 1)} came without a request"
    )
    if evidence is None:
        text = f"{counts}: the line occasionally loses, adds or changes bytes"
        return f"{text}; {Evidence(known=False).remedy}", figures
    event = evidence.text or "both ends counted the same bytes"
    if evidence.to_board < -repeated and evidence.to_board < -1:
        event += ", more than the repeated reads explain, as when a line is cut for a moment"
    return f"{event}: {counts}; {evidence.remedy}", figures | {"line": evidence.figures}
