"""`viform board bringup`: stage by stage, what of a board works."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rtl_model.bringup.bench.endpoint import csr_map, open_endpoint
from scenarios.cli.board.line import (
    Baud,
    Csr,
    Faults,
    Level,
    Log,
    LowLatency,
    PortName,
    TimeScale,
    told_latency,
)
from scenarios.cli.output import Json, SilentProgress, print_document

if TYPE_CHECKING:
    from rtl_model.bringup import Stage

__all__ = ["board_bringup", "print_stage"]


def board_bringup(
    port: PortName = "virtual",
    baud: Baud = 115_200,
    csr: Csr = None,
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html and junit.xml; made if need be")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=4096, help="of each captured burst")] = 8,
    all_stages: Annotated[
        bool, typer.Option("--all", help="go on behind a stage that failed, where that can be")
    ] = False,
    log: Log = None,
    time_scale: TimeScale = None,
    low_latency: LowLatency = False,
    level: Level = "bytes",
    fault: Faults = None,
    json: Json = False,
) -> None:
    """Bring a board up: port, bytes, identity, counters, registers, PRBS, pixel patterns, threshold
    sweep, frame timing. Exit 1 where a stage fails, with its cause."""
    from cosim import InputError
    from rtl_model.bringup import bring_up

    known = csr_map(csr)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            given = f"{out} ({exc.strerror})"
            raise InputError("--out", "a folder", given, "choose another") from exc

    def told(stage: Stage) -> None:
        if stage.figures.get("low_latency") is False:
            told_latency(stage.figures["port"], False)
        if not json:
            print_stage(stage)

    with open_endpoint(port, baud, time_scale, level=level, faults=fault) as place:
        report = bring_up(
            place.url,
            baud=baud,
            csr=known,
            stop_at_first=not all_stages,
            simulated=place.simulated,
            time_scale=place.time_scale,
            frames=frames,
            low_latency=low_latency,
            log=log,
            progress=told,
            note=SilentProgress().note,
        )
    files: list[str] = []
    if out is not None:
        from rtl_model.bringup.report.page import write_board_report

        files = write_board_report(report, out)
    if json:
        print_document(report.document() | {"files": [str(out / f) for f in files] if out else []})
    else:
        print("the board passes every stage" if report.ok else f"not passed: {report.cause}")
        for name in files:
            print(f"{'written':<12} {out}/{name}")
    if not report.ok:
        raise typer.Exit(1)


def print_stage(stage: Stage) -> None:
    """A line of a stage that ran."""
    if stage.outcome == "left out":
        return
    mark = "ok" if stage.outcome == "ok" else "FAILED"
    text = stage.cause if stage.cause is not None else _short(stage)
    print(f"{mark:<7} {stage.name:<10} {stage.seconds:7.2f} s  {text}", flush=True)


def _short(stage: Stage) -> str:
    from rtl_model.bringup.report.summary import summary

    return summary(stage)
