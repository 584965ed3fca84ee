"""The bring-up: stage after stage, until one fails; each in its own time, none for ever."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from cosim import InputError
from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.deadline import DeadlinePort, OutOfTime
from rtl_model.bringup.bench.evidence import Evidence
from rtl_model.bringup.bench.monitor import LineMonitor
from rtl_model.bringup.bench.stage import STAGES, Figures, Report, Stage, StageFault
from rtl_model.bringup.bench.uptime import Uptime
from rtl_model.bringup.stages.bytes import check_bytes
from rtl_model.bringup.stages.counters import check_counters
from rtl_model.bringup.stages.identity import check_identity
from rtl_model.bringup.stages.patterns import check_patterns
from rtl_model.bringup.stages.prbs import check_prbs
from rtl_model.bringup.stages.registers import check_registers
from rtl_model.bringup.stages.threshold import check_threshold
from rtl_model.bringup.stages.timing import check_timing
from rtl_model.host import (
    Cause,
    LineFault,
    Port,
    SerialPort,
    Uartbone,
    default_map,
    is_pty,
    open_port,
)
from rtl_model.host.csr import CsrMap
from rtl_model.host.log import Recorder
from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S
from rtl_model.registers import MAGIC

__all__ = ["ALLOWED_S", "bring_up"]

Progress = Callable[[Stage], None]

_CHECKS: dict[str, Callable[[Bench], Figures]] = {
    "bytes": check_bytes,
    "identity": check_identity,
    "counters": check_counters,
    "registers": check_registers,
    "prbs": check_prbs,
    "patterns": check_patterns,
    "threshold": check_threshold,
    "timing": check_timing,
}
_WATCH_S = 5.0
_NEEDED = ("port", "bytes", "identity")  # without these none can run

_ROUND_TRIPS_PER_S = 62  # with FTDI's latency timer as it comes
_PACE_MOST = 50.0
ALLOWED_S = {
    "bytes": 60.0, "identity": 20.0, "counters": 30.0, "registers": 60.0, "prbs": 60.0,
    "patterns": 120.0, "threshold": 180.0, "timing": 60.0,
}  # fmt: skip
"""Seconds of our time for each stage, at 62 round trips a second (FTDI's latency timer of 16 ms)
and 115 200 baud with room to spare; times the time scale of a slower simulated board, or as much
longer as answers take."""

_OF_DESIGN = {  # kinds that a line at fault brings about as well
    "stuck-bit", "alias", "memory", "reset", "restore", "scratch", "rate", "stands-still", "rows",
    "tick", "clock",
}  # fmt: skip


def bring_up(
    port: Port | str,
    *,
    baud: int = 115_200,
    csr: CsrMap | None = None,
    stop_at_first: bool = True,
    simulated: bool | None = None,
    time_scale: float = 1.0,
    frames: int = 8,
    low_latency: bool = False,
    log: Path | None = None,
    allowed_s: float | None = None,
    progress: Progress | None = None,
    note: Callable[[str], None] | None = None,
) -> Report:
    """Runs all stages on a board and returns what they found; no fault of a board raises.

    port: an open port, or a URL to be opened (and closed). csr: of the design; None is ours.
    stop_at_first: leave out what follows a failed stage; without port, bytes or identity nothing
        follows anyway. simulated: None says so of a pty alone. frames: of a burst.
    low_latency: asks the driver of a port that is opened here for it; the port stage says whether
        it was granted.
    allowed_s: for each stage, in place of the stage's own. progress: told of each stage.
    note: told in a line what takes long within one.
    InputError for a baud or URL that cannot be.
    """
    begun = time.monotonic()
    given = port if isinstance(port, str) else port.name
    report = Report(given, baud, is_pty(given) if simulated is None else simulated)

    def done(stage: Stage) -> None:
        report.stages.append(stage)
        if progress is not None:
            progress(stage)

    opened: Port | None = None
    recorder: Recorder | None = None
    try:
        try:
            opened = open_port(port, baud) if isinstance(port, str) else port
            guarded = DeadlinePort(opened)
        except LineFault as fault:
            done(_failed("port", time.monotonic() - begun, fault))
        else:
            told = _told(opened, report)
            if low_latency:
                told["low_latency"] = isinstance(opened, SerialPort) and opened.low_latency()
            done(Stage("port", "ok", None, told, time.monotonic() - begun))
            session = {"simulated": report.simulated, "time_scale": time_scale, "frames": frames}
            recorder = None if log is None else Recorder(log, opened, session=session)
            patience = SIMULATED_PATIENCE_S if report.simulated else PATIENCE_S
            bone = Uartbone(
                guarded,
                baud=baud,
                time_scale=time_scale,
                patience_s=patience * max(1.0, time_scale),
                log=recorder,
            )
            bench = Bench(
                guarded, bone, csr or default_map(), report.simulated, baud, frames=frames
            )
            if note is not None:
                bench.note = note
            for name, check in _CHECKS.items():
                fault_before = report.failed
                if fault_before is not None and (stop_at_first or fault_before.name in _NEEDED):
                    break
                allowed = allowed_s or ALLOWED_S[name] * _pace(report, time_scale)
                done(_run(name, check, bench, allowed))
            report.board, report.bursts = bench.board or None, list(bench.bursts)
            guarded.allow(5.0)
            _quiet(bench, report)
    finally:
        if recorder is not None:
            recorder.close()
        if isinstance(port, str) and opened is not None:
            opened.close()
    first = report.failed_stage
    for name in STAGES[len(report.stages) :]:
        done(Stage(name, "left out", f"stage {first} failed", {}, 0.0))
    report.wall_s = time.monotonic() - begun
    return report


def _pace(report: Report, time_scale: float) -> float:
    """By how much a stage may take longer than its time: as much as answers do."""
    answer_s = report.figure("bytes", "s_per_answer") or 0.0
    return max(1.0, time_scale, min(answer_s * _ROUND_TRIPS_PER_S, _PACE_MOST))


def _told(port: Port, report: Report) -> Figures:
    lines = getattr(port, "modem_lines", None)
    figures: Figures = {"port": port.name, "baud": report.baud}
    if report.simulated:
        figures["note"] = "simulated: no hardware is behind this port"
    elif lines is not None:
        figures["modem_lines"] = lines() or "none"
    return figures


def _run(name: str, check: Callable[[Bench], Figures], bench: Bench, allowed: float) -> Stage:
    """One stage, whatever becomes of it."""
    clock = bench.port.inner.now  # which tells the time even when it is over
    begun = clock()
    bench.port.allow(allowed)
    retried, strays = bench.bone.retried, bench.bone.strays

    def spent() -> float:
        return clock() - begun

    watch: Uptime | None = None
    try:
        if bench.monitor is None and bench.csr.ours and bench.magic == MAGIC:
            bench.monitor = LineMonitor(bench.bone, bench.csr)
            bench.monitor.begin()
        watch = None if bench.monitor is None else Uptime(bench)
        figures = check(bench)
        if bench.monitor is not None and bench.board:
            bench.monitor.geometry = bench.geometry
        found = _evidence(bench, bench.bone.retried - retried)
    except (LineFault, StageFault) as fault:
        bench.port.allow(_WATCH_S * max(1.0, bench.bone.time_scale))  # its time may be used up
        anew = None if watch is None else watch.restarted()
        late = None if anew else _late_evidence(bench, bench.bone.retried - retried)
        anew = anew or _restarted(None, late)
        return _failed(name, spent(), anew or fault, late)
    except OutOfTime:
        repeated = bench.bone.retried - retried
        told, figures = _out_of_time(name, bench, allowed)
        over = Stage(name, "failed", told, figures, spent(), "out-of-time")
        _settle(bench, repeated)
        return over
    except InputError as fault:  # a board that says what cannot be
        return Stage(name, "failed", str(fault), {}, spent(), "cannot-be")
    retried, strays = bench.bone.retried - retried, bench.bone.strays - strays
    if not (retried or strays or (found is not None and not found.clean)):
        return Stage(name, "ok", None, figures, spent())
    anew = _restarted(watch, found)  # all else was right, and the line is not
    if anew is not None:
        return _failed(name, spent(), anew)
    figures = figures | {"reads_repeated": retried, "stray_bytes": strays}
    return Stage(name, "failed", *_spoilt(found, figures), spent(), "spoilt")


def _out_of_time(name: str, bench: Bench, allowed: float) -> tuple[str, Figures]:
    """Cause and figures of a stage that was not done in its time."""
    bone = bench.bone
    return (
        f"stage {name} was not done within {allowed:g} s, after {bone.round_trips} round trips and "
        f"{bone.retried} repeats; check the line, or give a slower board more time with "
        "--time-scale",
        {"round_trips": bone.round_trips, "retried": bone.retried},
    )


def _settle(bench: Bench, repeats: int) -> None:
    """Lets an answer come that was under way when time ran out, and the sums begin anew: what
    follows has nothing to do with it."""
    bench.port.allow(_WATCH_S * max(1.0, bench.bone.time_scale))
    with suppress(LineFault, OutOfTime):
        bench.bone.resynchronise()
        _evidence(bench, repeats)


def _restarted(watch: Uptime | None, found: Evidence | None) -> StageFault | None:
    """The fault "restarted", by the uptime, or by the line's counters where the board had been up
    for so short a time that its uptime has passed that again."""
    told = None if watch is None else watch.restarted()
    if told is None and found is not None and found.anew:
        return StageFault(
            "restarted",
            "the board started anew within the stage: its counters of the line began at 0 again",
            "check its supply and its reset",
        )
    return told


def _evidence(bench: Bench, repeats: int) -> Evidence | None:
    if bench.monitor is None:
        return None
    return bench.monitor.take_evidence(repeats)


def _late_evidence(bench: Bench, repeats: int) -> Evidence | None:
    """That of a stage which failed, where it can be had."""
    try:
        return _evidence(bench, repeats)
    except (LineFault, OutOfTime):
        return None


def _spoilt(found: Evidence | None, figures: Figures) -> tuple[str, Figures]:
    """Cause and figures where the line did something to bytes."""
    repeated, strays = figures.get("reads_repeated", 0), figures.get("stray_bytes", 0)
    told = (
        f"{repeated} read{'s' * (repeated != 1)} had to be repeated and {strays} "
        f"byte{'s' * (strays != 1)} came unasked"
    )
    if found is None:
        text = f"{told}: the line loses, adds or changes bytes now and then"
        return f"{text}; {Evidence(known=False).mend}", figures
    what = found.text or "both ends counted the same bytes"
    if found.to_board < -repeated and found.to_board < -1:
        what += ", more of them than reads were repeated, as when a line is cut for a moment"
    return f"{what}: {told}; {found.mend}", figures | {"line": found.figures}


def _failed(
    name: str, seconds: float, fault: LineFault | StageFault, found: Evidence | None = None
) -> Stage:
    """A stage that failed. What the line did meanwhile is told as well, and is the cause itself
    where the fault would else be the design's."""
    if isinstance(fault, StageFault):
        kind, figures = fault.kind, fault.figures
    else:
        kind, figures = fault.cause.value, {}
    if found is None or not found.known or found.clean:
        return Stage(name, "failed", str(fault), figures, seconds, kind)
    figures = figures | {"line": found.figures}
    if kind in _OF_DESIGN:
        cause = f"{found.text}, so nothing follows from what was seen then: {fault.text}"
        return Stage(name, "failed", f"{cause}; {found.mend}", figures, seconds, "spoilt")
    return Stage(name, "failed", f"{fault}; meanwhile {found.text}", figures, seconds, kind)


def _quiet(bench: Bench, report: Report) -> None:
    """The sensor stands still afterwards, where it is ours and the line works."""
    if any(stage.name == "identity" and stage.outcome == "ok" for stage in report.stages):
        try:
            bench.write("sensor_run", 0)
        except (LineFault, OutOfTime) as fault:
            if isinstance(fault, LineFault) and fault.cause is Cause.DIFFERS:
                raise
