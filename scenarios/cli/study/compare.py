"""Comparisons: all cameras before one scene (`viform compare`), the methods of images on one stream
(`compare-methods`), flow and tracking against speed, by spikes and by frames (`compare-tracking`).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import number
from cosim.run.shown import make_progress
from scenarios.cli.options import Device, check_figure
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from scenarios.studies.methods import MethodRow


def compare(
    scene: Annotated[
        str, typer.Argument(help="a name from `viform list`, a TOML file, or a kind of scene")
    ] = "star",
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="override duration or a key of scene, lens, spike, or an imager such as ebaps",
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="seed of all temporal noise")] = None,
    out: Annotated[
        Path | None, typer.Option(help="folder to create [runs/compare-SCENE-N]")
    ] = None,
    device: Device = None,
    json: Json = False,
) -> None:
    """Record one scene with the spike camera and every other imager, and compare the results."""
    from scenarios.cli.start import BEGAN
    from scenarios.studies.compare import load_comparison, run_compare

    comparison = load_comparison(scene, assignments or (), seed)
    progress = make_progress()
    try:
        document, folder = run_compare(comparison, out, device, progress, BEGAN)
    finally:
        progress.close()
    if json:
        print_document(document)
    else:
        tell(*_cameras_text(document, folder))


def _cameras_text(document: dict[str, Any], folder: Path) -> list[str]:
    """The table as text."""
    from scenarios.studies.compare.measure import FIGURES, Figure
    from scenarios.studies.compare.report import HEADS, figure_text

    rows = document["rows"]
    cells = [["", *(row["title"] for row in rows)]]
    cells += [[HEADS[n], *(figure_text(n, Figure(**row[n])) for row in rows)] for n in FIGURES]
    widths = [max(len(line[n]) for line in cells) for n in range(len(cells[0]))]
    lines = [
        "  ".join([line[0].ljust(widths[0]),
                   *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
        for line in cells
    ]  # fmt: skip
    lines += [f"  {row['title']}: {row['setting']}" for row in rows]
    return [*lines, *document["notes"], f"{folder / 'report.html'}"]


def compare_methods(
    stream: Annotated[
        Path, typer.Argument(help="the folder of a run, or any stream that viform image opens")
    ],
    truth: Annotated[
        Path | None,
        typer.Option(help="true light, linear grey: .png, or .npy with white = 1 [the run's own]"),
    ] = None,
    at: Annotated[int | None, typer.Option(help="--truth: zero-based cycle of its instant")] = None,
    scale: Annotated[
        float | None, typer.Option(help="--truth: rate of white, spikes a cycle [1]")
    ] = None,
    ties: Annotated[
        str, typer.Option(help="tfi: interval of a spike at the instant, before or after it")
    ] = "before",
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Compare the images of all methods with the true light: PSNR, SSIM, edges, processor time.

    Windows are searched for the best PSNR.
    """
    import math
    from dataclasses import asdict

    from cosim import InputError
    from cosim.files import notes_of
    from scenarios.assemble.source.latched.dim import dim_of_run
    from scenarios.studies import methods
    from sensor.codec.files import open_any
    from sensor.reconstruct.catalogue import check_ties

    held = check_ties(ties, "tfi")
    if truth is not None and at is None:
        raise InputError("--at", "given with --truth", "absent", "add the cycle of its instant")
    for option, given in (("--at", at), ("--scale", scale)):
        if truth is None and given is not None:
            raise InputError(option, "given with --truth", f"{given:g} alone", "leave it out")
    if scale is not None and not (math.isfinite(scale) and scale > 0):
        raise InputError("--scale", "a number above 0", f"{scale:g}", "write the rate of white")
    opened, notes = open_any(stream, size_option(size))
    if truth is None:
        truths, white = methods.truth_of_run(stream, opened.shape)
    else:
        assert at is not None
        truths, white = {at: methods.truth_of_file(truth, opened.shape)}, scale or 1.0
    progress = make_progress()
    try:
        light = dim_of_run(stream)
        rows = methods.compare_methods(opened, truths, white, light, progress, ties=held)
    finally:
        progress.close()
    for note in (*notes, *notes_of(opened)):
        progress.note(note)
    if json:
        print_document(
            {"stream": str(stream), "instants": list(truths), "white_rate": white,
             "cycles": opened.cycles, "height": opened.shape[0], "width": opened.shape[1],
             "ties": held, "rows": [asdict(row) for row in rows]}
        )  # fmt: skip
        return
    print(_methods_text(rows))
    cycles = ", ".join(map(str, truths))
    tell(f"cycle {cycles}; white {number(white)} spikes a cycle; windows of the best PSNR")


def _methods_text(rows: list[MethodRow]) -> str:
    """The table as text."""
    cells = [["method", "window", "PSNR dB", "SSIM", "edge px", "processor ms", "not aligned"]]
    cells += [
        [
            row.method, "" if row.window is None else str(row.window), f"{row.psnr_db:.2f}",
            f"{row.ssim:.4f}", "" if row.edge_px is None else f"{row.edge_px:.2f}",
            f"{1e3 * row.processor_s:.1f}",
            "" if row.plain_share is None else f"{100 * row.plain_share:.2f} %",
        ]
        for row in rows
    ]  # fmt: skip
    widths = [max(len(line[n]) for line in cells) for n in range(len(cells[0]))]
    return "\n".join(
        "  ".join(
            [line[0].ljust(widths[0]),
             *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))]
        ).rstrip()
        for line in cells
    )  # fmt: skip


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
    from cosim.files.atomic import atomic_write
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
        with atomic_write(figure) as part:
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
