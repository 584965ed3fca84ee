"""The bring-up: runs the stages in order until one fails, each within its own time limit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rtl_model.bringup.bench.bench import SerialBench
from rtl_model.bringup.bench.deadline import DeadlinePort
from rtl_model.bringup.bench.stage import STAGES, Figures, Report, Stage
from rtl_model.bringup.one_stage import BringUp, failed_stage, run_stage, stop_sensor
from rtl_model.bringup.over_udp import bring_up_over_udp
from rtl_model.bringup.stages.bytes import check_bytes
from rtl_model.bringup.stages.counters import check_counters
from rtl_model.bringup.stages.identity import check_identity
from rtl_model.bringup.stages.patterns import check_patterns
from rtl_model.bringup.stages.prbs import check_prbs
from rtl_model.bringup.stages.registers import check_registers
from rtl_model.bringup.stages.threshold import check_threshold
from rtl_model.bringup.stages.timing import check_timing
from rtl_model.host import (
    LineFault,
    Port,
    SerialPort,
    Uartbone,
    default_map,
    is_pty,
    open_port,
)
from rtl_model.host.ether import is_udp
from rtl_model.host.log import LineLog
from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S

CHECKS: dict[str, Callable[[SerialBench], Figures]] = {
    "bytes": check_bytes,
    "identity": check_identity,
    "counters": check_counters,
    "registers": check_registers,
    "prbs": check_prbs,
    "patterns": check_patterns,
    "threshold": check_threshold,
    "timing": check_timing,
}
_REQUIRED = ("port", "bytes", "identity")  # all other stages depend on these

_ROUND_TRIPS_PER_S = 62  # with the default latency timer of FTDI adapters, 16 ms
_PACE_MOST = 50.0
_ROUND_TRIPS = 2300
"""Round trips of a whole bring-up: 2 275 to 2 311, counted for 4 x 40 and 32 x 32 pixels."""
_LONG_S = 60.0  # duration of a bring-up that is announced
ALLOWED_S = {
    "bytes": 60.0, "identity": 20.0, "counters": 30.0, "registers": 60.0, "prbs": 60.0,
    "patterns": 120.0, "threshold": 180.0, "timing": 60.0,
}  # fmt: skip
"""Time limit of each stage at 62 round trips per second and 115 200 baud, with a margin, s.

It is host time. It grows with the time scale of a slower simulated board, or in proportion to the
duration of the answers."""


def bring_up(
    port: Port | str,
    options: BringUp | None = None,
    progress: Callable[[Stage], None] = lambda stage: None,
    note: Callable[[str], None] = lambda text: None,
) -> Report:
    """Runs all stages on a board. The report contains the faults of the board; none is raised.

    Args:
        port: an open serial port, or the name of a port over any line. A port that is opened here
            is closed at the end.
        options: options of the bring-up; the defaults if None.
        progress: receives each stage when it has ended.
        note: receives one line before a slow step.

    Raises InputError for a baud or URL that cannot be used.
    """
    chosen = options or BringUp()
    if isinstance(port, str) and is_udp(port):
        return bring_up_over_udp(port, chosen, progress, note)
    begin = time.monotonic()
    name = port if isinstance(port, str) else port.name
    simulated = is_pty(name) if chosen.simulated is None else chosen.simulated
    report = Report(name, chosen.baud, simulated)

    def add(stage: Stage) -> None:
        report.stages.append(stage)
        progress(stage)

    try:
        opened = open_port(port, chosen.baud, lines=chosen.lines) if isinstance(port, str) else port
    except LineFault as fault:
        add(failed_stage("port", time.monotonic() - begin, fault))
    else:
        try:
            figures = _port_figures(opened, report, chosen.low_latency)
            add(Stage("port", "ok", None, figures, time.monotonic() - begin))
            _run_stages(opened, chosen, report, add, note)
        finally:
            if isinstance(port, str):
                opened.close()
    first = report.failed_stage
    for each in STAGES[len(report.stages) :]:
        add(Stage(each, "left out", f"stage {first} failed", {}, 0.0))
    report.wall_s = time.monotonic() - begin
    return report


def _run_stages(
    port: Port,
    options: BringUp,
    report: Report,
    add: Callable[[Stage], None],
    note: Callable[[str], None],
) -> None:
    """Runs the stages after `port`, until one fails on which the others depend."""
    scale = options.time_scale
    recorder: LineLog | None = None
    if options.log is not None:
        session: dict[str, Any] = {
            "simulated": report.simulated, "time_scale": scale, "frames": options.frames,
        }  # fmt: skip
        recorder = LineLog(options.log, port, session=session)
    try:
        guarded = DeadlinePort(port)
        patience = SIMULATED_PATIENCE_S if report.simulated else PATIENCE_S
        bone = Uartbone(
            guarded, baud=options.baud, time_scale=scale, patience_s=patience * max(1.0, scale),
            log=recorder,
        )  # fmt: skip
        bench = SerialBench(
            guarded, bone, options.csr or default_map(), report.simulated, options.frames,
            note=note, nominal_baud=options.baud,
        )  # fmt: skip
        for name, check in CHECKS.items():
            failed = report.failed
            if failed is not None and (options.stop_at_first or failed.name in _REQUIRED):
                break
            allowed = options.allowed_s or ALLOWED_S[name] * _pace(report, scale)
            add(run_stage(name, check, bench, allowed))
            if name == "bytes":
                _announce_duration(report, note)
        report.board, report.bursts = bench.board or None, list(bench.bursts)
        guarded.allow(5.0)
        stop_sensor(bench, report)
    finally:
        if recorder is not None:
            recorder.close()


def _announce_duration(report: Report, note: Callable[[str], None]) -> None:
    """Notes the expected duration if answers are slow."""
    answer_s = report.figure("bytes", "s_per_answer") or 0.0
    if answer_s * _ROUND_TRIPS > _LONG_S:
        note(
            f"an answer takes {1e3 * answer_s:.0f} ms, so the bring-up takes about "
            f"{answer_s * _ROUND_TRIPS / 60:.0f} minutes"
        )


def _pace(report: Report, time_scale: float) -> float:
    """Factor of the time limits: ratio of the measured to the usual duration of an answer."""
    answer_s = report.figure("bytes", "s_per_answer") or 0.0
    return max(1.0, time_scale, min(answer_s * _ROUND_TRIPS_PER_S, _PACE_MOST))


def _port_figures(port: Port, report: Report, low_latency: bool) -> Figures:
    lines = getattr(port, "modem_lines", None)
    figures: Figures = {"port": port.name, "baud": report.baud}
    if report.simulated:
        figures["note"] = "simulated: no hardware is behind this port"
    elif lines is not None:
        figures["modem_lines"] = lines() or "none"
    if low_latency:
        figures["low_latency"] = isinstance(port, SerialPort) and port.low_latency()
    return figures
