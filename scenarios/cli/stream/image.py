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
        str, typer.Option(help="cycles of tau that become black, or 'auto' for the longest")
    ] = "255",
    scale: Annotated[float, typer.Option(help="rate that becomes white")] = 1.0,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Write the image at an instant: round(255 clip(x / scale, 0, 1)), 8-bit grey."""
    import math

    from cosim import InputError
    from cosim.files import notes_of
    from cosim.report.png import to_linear_bytes, write_png
    from sensor import METHODS, tau_image, tfi, tfp
    from sensor.codec.files import open_any

    if method not in METHODS:
        raise InputError("--method", f"one of {', '.join(METHODS)}", repr(method), "choose one")
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(
            "--scale", "a number above 0", f"{scale:g}", "write the white_rate of the run"
        )
    if longest != "auto" and not (longest.isdecimal() and int(longest) > 0):
        raise InputError(
            "--longest",
            "a number of cycles above 0, or auto",
            repr(longest),
            "leave it out for 255",
        )
    opened, notes = open_any(stream, size_option(size))
    if method == "tau":
        grey = tau_image(opened, at, None if longest == "auto" else int(longest))
    else:
        rate = tfp(opened, at, window, preceding=preceding) if method == "tfp" else tfi(opened, at)
        grey = to_linear_bytes(rate, scale)
    write_png(out, grey)
    for note in (*notes, *notes_of(opened)):
        SilentProgress().note(note)
    if json:
        print_document(
            {
                "stream": str(stream), "out": str(out), "method": method, "at": at,
                "window": window if method == "tfp" else None,
                "scale": None if method == "tau" else scale,
                "cycles": opened.cycles, "height": opened.shape[0], "width": opened.shape[1],
            }
        )  # fmt: skip
