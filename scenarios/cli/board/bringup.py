"""`viform board bringup`: checks a board stage by stage."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.run.shown import SilentProgress
from scenarios.cli.board.connection import (
    BoardOptions,
    endpoint_of,
    known_map,
    warn_of_latency,
)
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.bringup.bench.stage import Stage


@expand_options
def board_bringup(
    options: BoardOptions,
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html and junit.xml, created if missing")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=4096, help="frames in each captured burst")] = 8,
    all_stages: Annotated[
        bool, typer.Option("--all", help="continue after a failed stage, if possible")
    ] = False,
    json: Json = False,
) -> None:
    """Bring a board up: port, bytes, identity, counters, registers, PRBS, pixel patterns, threshold
    sweep, frame timing; over UDP also packet loss, longest packets and payload rate. Exit 1 if a
    stage fails, with its cause."""
    from cosim import InputError
    from rtl_model.bringup.run import BringUp, bring_up
    from rtl_model.host.bone import check_answers
    from rtl_model.host.ether import is_udp

    csr = known_map(options.csr)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            actual = f"{out} ({exc.strerror})"
            raise InputError("--out", "a folder", actual, "choose another") from exc

    def report_stage(stage: Stage) -> None:
        if stage.figures.get("low_latency") is False:
            warn_of_latency(stage.figures["port"])
        if not json:
            print_stage(stage)

    with endpoint_of(options) as endpoint:
        bring_up_options = BringUp(
            baud=endpoint.baud,
            csr=csr,
            stop_at_first=not all_stages,
            simulated=endpoint.simulated,
            time_scale=endpoint.time_scale,
            frames=frames,
            low_latency=options.low_latency,
            lines=endpoint.lines,
            log=options.log,
        )
        if is_udp(endpoint.url):
            check_answers(endpoint.url, endpoint.simulated, endpoint.time_scale)
        report = bring_up(endpoint.url, bring_up_options, report_stage, SilentProgress().note)
    files: list[str] = []
    if out is not None:
        from rtl_model.bringup.report.page import write_board_report

        files = write_board_report(report, out)
    if json:
        print_document(report.document() | {"files": [str(out / f) for f in files] if out else []})
    else:
        tell("the board passes every stage" if report.ok else f"not passed: {report.cause}")
        for name in files:
            tell(f"{'written':<12} {out}/{name}")
    if not report.ok:
        raise typer.Exit(1)


def print_stage(stage: Stage) -> None:
    """Prints the line of a stage that has run."""
    if stage.outcome == "left out":
        return
    mark = "ok" if stage.outcome == "ok" else "FAILED"
    text = stage.cause if stage.cause is not None else _short(stage)
    tell(f"{mark:<7} {stage.name:<10} {stage.seconds:7.2f} s  {text}")
    sys.stdout.flush()


def _short(stage: Stage) -> str:
    from rtl_model.bringup.report.summary import stage_text

    return stage_text(stage)
