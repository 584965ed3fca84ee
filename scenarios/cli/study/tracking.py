"""`viform compare-tracking`: flow and tracking against speed, by spikes and by frames."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cosim.config.amounts import number
from cosim.run.shown import make_progress
from scenarios.cli.options import check_figure
from scenarios.cli.output import Json, print_document, tell


def compare_tracking(
    speeds: Annotated[
        str, typer.Option(metavar="A,B,C", help="speeds, pixels/ms")
    ] = "0.1,0.3,1,3,10,30,100",
    frame_rates: Annotated[
        str, typer.Option(metavar="A,B,C", help="rates of cameras with frames, frames/s")
    ] = "60,240,1000",
    white: Annotated[
        float, typer.Option(help="light: spikes a cycle of white in the spike camera")
    ] = 0.6,
    trials: Annotated[int, typer.Option(help="repetitions at each speed")] = 10,
    seed: Annotated[int, typer.Option(help="seed of all random numbers")] = 1,
    figure: Annotated[Path | None, typer.Option(help="PNG to draw")] = None,
    json: Json = False,
) -> None:
    """Compare optical flow, detection and tracking of fast motion by spikes and by frames.

    The same algorithms work on spikes and on frames of ideal cameras in the same light. Endpoint
    error, track loss and latency are those against the closed form of the scene.
    """
    from cosim.files.whole import whole
    from scenarios.studies.tracking import (
        Conditions,
        run_tracking,
        tracking_document,
        tracking_figure,
        tracking_table,
    )

    check_figure(figure)
    conditions = Conditions(
        tuple(sorted(1e3 * speed for speed in _numbers("--speeds", speeds))),
        tuple(sorted(_numbers("--frame-rates", frame_rates))), trials, seed, white,
    )  # fmt: skip
    progress = make_progress()
    try:
        rows = run_tracking(conditions, progress)
    finally:
        progress.close()
    if figure is not None:
        with whole(figure) as part:
            tracking_figure(part, rows)
    if json:
        print_document(tracking_document(conditions, rows))
        return
    print(tracking_table(rows))
    light = f"white {number(conditions.electrons)} electrons/s in each pixel"
    tell(f"{light}; {trials} trials, seed {seed}")
    if figure is not None:
        tell(f"figure  {figure}")


def _numbers(option: str, text: str) -> list[float]:
    """Numbers of a text with commas. Raises InputError."""
    from cosim import InputError

    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            option, "numbers with commas between, such as 1,10,100", repr(text),
            "write it in this form",
        ) from None  # fmt: skip
