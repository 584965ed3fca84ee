"""The bring-up of a board over UDP: the same checks of the design, others of the line.

A lost packet is no failure, because it is repeated: the figures of each stage count the losses, and
the stage `loss` names them. There is no counterpart of the serial line's evidence, because
datagrams have checksums.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cosim import InputError
from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.deadline import DeadlineSocket, OutOfTime
from rtl_model.bringup.bench.stage import UDP_STAGES, Figures, Report, Stage, StageFault
from rtl_model.bringup.one_stage import BringUp, Uptime, failed_stage, stop_sensor
from rtl_model.bringup.stages.ethernet import check_link, check_loss, check_mtu, check_rate
from rtl_model.bringup.stages.identity import check_identity
from rtl_model.bringup.stages.patterns import check_patterns
from rtl_model.bringup.stages.prbs import check_prbs
from rtl_model.bringup.stages.registers import check_registers
from rtl_model.bringup.stages.threshold import check_threshold
from rtl_model.bringup.stages.timing import check_timing
from rtl_model.host import LineFault, LineLog, default_map
from rtl_model.host.bone import patience_s
from rtl_model.host.ether import Etherbone, is_loopback, open_udp
from rtl_model.registers import MAGIC

_CHECKS: dict[str, Callable[[UdpBench], Figures]] = {
    "link": check_link,
    "identity": check_identity,
    "loss": check_loss,
    "mtu": check_mtu,
    "registers": check_registers,
    "prbs": check_prbs,
    "patterns": check_patterns,
    "threshold": check_threshold,
    "timing": check_timing,
    "rate": check_rate,
}
_REQUIRED = ("link", "identity")  # all other stages depend on these
_ALLOWED_S = {
    "link": 30.0, "identity": 20.0, "loss": 30.0, "mtu": 60.0, "registers": 60.0, "prbs": 60.0,
    "patterns": 120.0, "threshold": 180.0, "timing": 60.0, "rate": 30.0,
}  # fmt: skip
"""Time limit of each stage, s of the host's time. It grows with the time scale."""


def bring_up_over_udp(
    url: str,
    options: BringUp,
    progress: Callable[[Stage], None],
    note: Callable[[str], None],
) -> Report:
    """Runs all stages over UDP; arguments as `bring_up`.

    Raises InputError for a host that is not found.
    """
    begin = time.monotonic()
    simulated = is_loopback(url) if options.simulated is None else options.simulated
    socket = open_udp(url)
    report = Report(socket.name, None, simulated, UDP_STAGES)

    def add(stage: Stage) -> None:
        report.stages.append(stage)
        progress(stage)

    recorder: LineLog | None = None
    try:
        figures: Figures = {"port": socket.name, "same_port": socket.same_port}
        if simulated:
            figures["note"] = "simulated: no hardware is behind this address"
        add(Stage("port", "ok", None, figures, time.monotonic() - begin))
        scale = options.time_scale
        if options.log is not None:
            session: dict[str, Any] = {
                "simulated": simulated, "time_scale": scale, "frames": options.frames,
            }  # fmt: skip
            recorder = LineLog(options.log, socket, session=session)
        guarded = DeadlineSocket(socket)
        bone = Etherbone(
            guarded, time_scale=scale, patience_s=patience_s(simulated, scale), log=recorder
        )
        csr = options.csr or default_map()
        bench = UdpBench(guarded, bone, csr, simulated, options.frames, note=note)
        for name, check in _CHECKS.items():
            failed = report.failed
            if failed is not None and (options.stop_at_first or failed.name in _REQUIRED):
                break
            allowed = options.allowed_s or _ALLOWED_S[name] * max(1.0, scale)
            add(_run_stage(name, check, bench, allowed))
        report.board, report.bursts = bench.board or None, list(bench.bursts)
        guarded.allow(5.0)
        stop_sensor(bench, report)
    finally:
        if recorder is not None:
            recorder.close()
        socket.close()
    first = report.failed_stage
    for each in UDP_STAGES[len(report.stages) :]:
        add(Stage(each, "left out", f"stage {first} failed", {}, 0.0))
    report.wall_s = time.monotonic() - begin
    return report


def _run_stage(
    name: str, check: Callable[[UdpBench], Figures], bench: UdpBench, allowed: float
) -> Stage:
    """Runs the check of a stage within its time limit."""
    clock = bench.port.inner.now  # not limited by the deadline
    begin, before = clock(), replace(bench.bone.exchange.counts)
    bench.port.allow(allowed)
    uptime: Uptime | None = None
    try:
        known = bench.csr.is_viform_board and bench.magic == MAGIC
        uptime = Uptime(bench) if known else None
        figures = check(bench)
    except (LineFault, StageFault) as fault:
        bench.port.allow(allowed)  # its time limit may have passed
        restart = _restarted(uptime)
        return failed_stage(name, clock() - begin, restart or fault)
    except OutOfTime:
        counts = bench.bone.exchange.counts.since(before)
        cause = (
            f"stage {name} was not done within {allowed:g} s, after {counts.answered} round trips "
            f"and {counts.lost} lost packets; check the network, or give a slower board more time "
            "with --time-scale"
        )
        figures = {"round_trips": counts.answered, "packets_lost": counts.lost}
        return Stage(name, "failed", cause, figures, clock() - begin, "out-of-time")
    except InputError as fault:  # the board states a value that is not allowed
        return Stage(name, "failed", str(fault), {}, clock() - begin, "cannot-be")
    bench.port.allow(allowed)
    restart = _restarted(uptime)
    if restart is not None:
        return failed_stage(name, clock() - begin, restart)
    if name != "loss":
        figures = figures | _losses(bench, before)
    return Stage(name, "ok", None, figures, clock() - begin)


def _losses(bench: UdpBench, before: Any) -> Figures:
    counts = bench.bone.exchange.counts.since(before)
    found = {
        "packets_lost": counts.lost, "packets_repeated": counts.repeated,
        "packets_reordered": counts.reordered,
    }  # fmt: skip
    return {"packets": counts.sent, **found} if any(found.values()) else {}


def _restarted(uptime: Uptime | None) -> StageFault | None:
    return None if uptime is None else uptime.restarted()
