"""`viform run`: run a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.run.shown import SilentProgress, make_progress
from scenarios.cli.options import (
    Draws,
    ScenarioName,
    ScenarioOptions,
    Scheduler,
    Tolerance,
    expand_options,
)
from scenarios.cli.output import Json, print_document, print_json, tell

if TYPE_CHECKING:
    from cosim.run.result import Result

_FURTHER = (
    "latency_bright_us", "total_light", "spike_rate", "white_rate", "f_number", "shown_rate",
    "shown_lost", "shown_clipped", "camera_frames", "camera_banding", "camera_flicker",
)  # fmt: skip
"""Metrics that are printed below the table of a run with a display."""


@expand_options
def run(
    options: ScenarioOptions,
    scenario: ScenarioName = "glass",
    tolerance: Tolerance = None,
    draws: Draws = None,
    out: Annotated[Path | None, typer.Option(help="folder to create [runs/SCENARIO-N]")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="continue the interrupted run in --out")
    ] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            help="waveforms of a virtual board, or of the first frames of an imager, .fst or .vcd"
        ),
    ] = None,
    store: Annotated[
        str,
        typer.Option(
            help="recorded streams: raw (fastest), fast, small (slowest), or none (not kept)"
        ),
    ] = "fast",
    workers: Annotated[
        int | None,
        typer.Option(help="processes that simulate the rows of a latched chip in bands [none]"),
    ] = None,
    scheduler: Scheduler = None,
    report: Annotated[
        str,
        typer.Option(help="page: images, figures and report.html; none: result and streams alone"),
    ] = "page",
    json: Json = False,
) -> None:
    """Run a scenario, and write its stream, images and report."""
    from cosim.run.machine import NO_REPORT, Options
    from scenarios.assemble.machine import check_options
    from scenarios.cli.start import BEGAN
    from scenarios.run import run_scenario

    name, loaded = options.load(scenario, tolerance, draws)
    run_options = Options(options.device, resume, trace, store, workers, scheduler, report)
    check_options(loaded, run_options)
    if resume and out is not None:
        from scenarios.assemble.resuming import done_before

        before = done_before(name, loaded, out)
        if before is not None:
            _print_done(before, out, trace, json)
            return
    progress = make_progress()
    try:
        done = run_scenario(name, loaded, out, options=run_options, progress=progress, began=BEGAN)
    finally:
        progress.close()
    lines = done.outcome.table, done.outcome.verdict
    print_result(done.result, done.folder, *lines, json, paged=report != NO_REPORT)
    _end(done.result)


def _end(result: Result) -> None:
    if result.outcome == "failed":  # a valid run with a negative result
        raise typer.Exit(1)


def _print_done(result: Result, folder: Path, trace: Path | None, json: bool) -> None:
    """Notes that the run is complete already, and prints its result."""
    from cosim import InputError
    from cosim.run.result import viform_version
    from scenarios.assemble.resuming import verdict_before

    if trace is not None:
        raise InputError(
            "--trace", "given with a run that is not complete", f"given with {folder}, which is "
            "complete", "give another --out",
        )  # fmt: skip
    by = "" if result.version == viform_version() else f", by version {result.version}"
    SilentProgress().note(
        f"already done in {folder}, on {result.device}{by}; to run it again, give another --out"
    )
    if json:
        print_json((folder / "result.json").read_text(encoding="utf-8"))
    else:
        paged = "report.html" in result.files
        print_result(result, folder, [], verdict_before(folder), json, paged=paged)
    _end(result)


def print_result(
    result: Result, folder: Path, table: list[str], verdict: list[str], json: bool, *,
    paged: bool = True,
) -> None:  # fmt: skip
    """Prints the document of a result, or its figures as text.

    Args:
        result: result of the run.
        folder: folder of the run.
        table: lines of a display, which replace most metrics.
        verdict: lines of a link, printed first; its unknown metrics share one line.
        json: whether the document is printed.
        paged: whether the run has a page.
    """
    from cosim.config.amounts import amount, elapsed

    if json:
        print_document(result.document())
        return
    for line in table:
        tell(line)
    metrics = {
        name: metric for name, metric in result.metrics.items() if not table or name in _FURTHER
    }
    wide = max([12, *(len(key) for key in metrics)])
    if verdict:
        tell(f"{'outcome':<{wide}} {result.outcome}")
    for n, text in enumerate(verdict):
        tell(f"{'' if n else 'verdict':<{wide}} {text}")
    unknown = []
    for key, metric in metrics.items():
        if key in ("full_physics", "camera"):
            continue
        if verdict and metric.value is None:
            unknown.append(key)
            continue
        value = "unknown" if metric.value is None else amount(metric.value, metric.unit, 4)
        tell(f"{key:<{wide}} {value}")
    if unknown:
        tell(f"{'unknown':<{wide}} {', '.join(unknown)}")
    for name_of, text in _checked(result):
        tell(f"{name_of:<{wide}} {text}")
    light = amount(result.simulated_s, "s", 4)
    tell(f"{'run time':<{wide}} {elapsed(result.run_time_s)} for {light} of light")
    if not verdict:
        tell(f"{'outcome':<{wide}} {result.outcome}")
    name_of, file = ("report", "report.html") if paged else ("result", "result.json")
    tell(f"{name_of:<{wide}} {folder / file}")


def _checked(result: Result) -> list[tuple[str, str]]:
    """Labels and texts of the lines on the error, on the run time of full physics, and on the
    effects left out."""
    from cosim.config.amounts import elapsed, number
    from cosim.plan.error import OTHER_NOISE
    from cosim.run.result import measured_text

    error, lines = result.error, []
    if error.value is None:
        lines.append(("error", "unknown" if error.kind is None else f"unknown: {error.kind}"))
    else:
        high = "" if error.ci is None else f", at most {number(error.ci[1], 2)} (99.9 %)"
        law = error.of == "law"
        how = "in law against" if law else "of the run against"
        lines.append(("error", f"{number(error.value, 2)}{high} {how} full physics; {error.kind}"))
        if law:
            lines.append(("", OTHER_NOISE))
    full, camera = (result.metrics.get(name) for name in ("full_physics", "camera"))
    if full is not None and full.value is not None:
        text = f"{elapsed(full.value)} predicted for the camera"
        if camera is not None and camera.value is not None:
            text += f", which took {elapsed(camera.value)}"
        lines.append(("full physics", text))
    for n, row in enumerate(result.left_out):
        promised = number(row["bound"], 2)
        text = f"{row['effect']}: bound {promised} ({row['kind']}), {measured_text(row)}"
        lines.append(("" if n else "left out", text))
    return lines if result.left_out else [*lines, ("left out", "nothing")]
