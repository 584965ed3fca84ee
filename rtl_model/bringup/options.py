"""Options of a bring-up, and its end, over any line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.deadline import OutOfTime
from rtl_model.bringup.bench.stage import Report
from rtl_model.host import Cause, LineFault, Lines
from rtl_model.host.csr import CsrMap
from rtl_model.host.ports import AS_EVER


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


def stop_sensor(bench: Bench, report: Report) -> None:
    """Stops the sensor of a Viform board, if the line works."""
    if any(stage.name == "identity" and stage.outcome == "ok" for stage in report.stages):
        try:
            bench.write("sensor_run", 0)
        except (LineFault, OutOfTime) as fault:
            if isinstance(fault, LineFault) and fault.cause is Cause.DIFFERS:
                raise
