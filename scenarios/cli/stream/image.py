"""`viform image`: an image from a stream at one instant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.output import Json, SilentProgress, print_document, size_option

__all__ = ["image"]


def image(
    stream: Annotated[
        Path,
        typer.Argument(
            help=".dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl, or the folder of a run"
        ),
    ],
    out: Annotated[Path, typer.Option(help="PNG to write")],
    at: Annotated[int, typer.Option(help="zero-based cycle of the instant")],
    method: Annotated[
        str, typer.Option(help="tfp, tfi, or tau (255 - tau, see --longest)")
    ] = "tfp",
    window: Annotated[int, typer.Option(help="window of tfp, an odd number of cycles")] = 41,
    preceding: Annotated[
        bool, typer.Option("--preceding", help="end the window of tfp with the instant")
    ] = False,
    longest: Annotated[
        str | None,
        typer.Option(help="cycles of tau that become black, or 'auto' for the longest [255]"),
    ] = None,
    scale: Annotated[float, typer.Option(help="rate that becomes white")] = 1.0,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Write the image at an instant: round(255 clip(x / scale, 0, 1)), 8-bit grey. A run that reads
    below threshold, or rejects the dark, has its dim pixels by that in tfp and tfi."""
    import math

    from cosim import InputError
    from cosim.files import notes_of
    from cosim.report.png import to_linear_bytes, write_png
    from scenarios.assemble.dim_of_run import dim_of_run
    from sensor import METHODS, isi, tau_levels, tfi, tfp
    from sensor.codec.files import open_any
    from sensor.reconstruct import tfp_span

    if method not in METHODS:
        raise InputError("--method", f"one of {', '.join(METHODS)}", repr(method), "choose one")
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(
            "--scale", "a number above 0", f"{scale:g}", "write the white_rate of the run"
        )
    for option, own, given in (
        ("--preceding", "tfp", preceding), ("--longest", "tau", longest is not None),
    ):  # fmt: skip
        if given and method != own:
            raise InputError(option, f"given with --method {own}", f"with {method}", "leave it out")
    if longest not in (None, "auto") and not (longest.isdecimal() and int(longest) > 0):
        raise InputError(
            "--longest",
            "a number of cycles above 0, or auto",
            repr(longest),
            "leave it out for 255",
        )
    opened, notes = open_any(stream, size_option(size))
    dim, black, span = None, None, None
    if method == "tau":
        tau = isi(opened, at)
        black = max(int(tau.max(initial=0)), 1) if longest == "auto" else int(longest or 255)
        grey = tau_levels(tau, black)
    else:
        if method == "tfp":
            span = tfp_span(opened, at, window, preceding=preceding)
            rate = tfp(opened, at, window, preceding=preceding)
        else:
            rate = tfi(opened, at)
        light = dim_of_run(stream)
        if light is not None:
            dim = light.at(opened, at)
            rate = dim.put(rate)
        grey = to_linear_bytes(rate, scale)
    write_png(out, grey)
    for note in (*notes, *notes_of(opened)):
        SilentProgress().note(note)
    if json:
        print_document(
            {
                "stream": str(stream), "out": str(out), "method": method, "at": at,
                "window": window if method == "tfp" else None,
                "window_cycles": None if span is None else span[1] - span[0],
                "preceding": preceding if method == "tfp" else None, "longest": black,
                "sub_threshold_pixels": None if dim is None else int(dim.read.sum()),
                "dark_pixels": None if dim is None else int(dim.dark.sum()),
                "scale": None if method == "tau" else scale,
                "cycles": opened.cycles, "height": opened.shape[0], "width": opened.shape[1],
            }
        )  # fmt: skip
