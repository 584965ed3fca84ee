"""`viform compare-methods`: the methods of images on one stream, beside the true light."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.config.amounts import number
from cosim.run.shown import make_progress
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from scenarios.studies.methods import MethodRow


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
    from scenarios.assemble.camera.dim import dim_of_run
    from scenarios.studies import methods
    from sensor.codec.files import open_any

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
        rows = methods.compare_methods(opened, truths, white, dim_of_run(stream), progress)
    finally:
        progress.close()
    for note in (*notes, *notes_of(opened)):
        progress.note(note)
    if json:
        print_document(
            {"stream": str(stream), "instants": list(truths), "white_rate": white,
             "cycles": opened.cycles, "height": opened.shape[0], "width": opened.shape[1],
             "rows": [asdict(row) for row in rows]}
        )  # fmt: skip
        return
    print(_text(rows))
    cycles = ", ".join(map(str, truths))
    tell(f"cycle {cycles}; white {number(white)} spikes a cycle; windows of the best PSNR")


def _text(rows: list[MethodRow]) -> str:
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
