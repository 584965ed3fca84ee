"""`viform image`, also as `viform reconstruct`: an image from a stream at one instant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.run.shown import SilentProgress
from scenarios.cli.options import check_figure
from scenarios.cli.output import Json, print_document, size_option


def image(
    stream: Annotated[
        Path,
        typer.Argument(
            help=".dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl, or the folder of a run"
        ),
    ],
    out: Annotated[Path, typer.Option(help="PNG, or .npy of spikes a cycle, to write")],
    at: Annotated[int, typer.Option(help="zero-based cycle of the instant")],
    method: Annotated[
        str,
        typer.Option(help="tfp, tfi, tfstp, motion-tfp, or tau (255 - tau, see --longest)"),
    ] = "tfp",
    window: Annotated[
        int | None,
        typer.Option(help="cycles; odd if centred [41, tfstp 161, motion-tfp 201, else all]"),
    ] = None,
    preceding: Annotated[
        bool, typer.Option("--preceding", help="use no spike after the instant")
    ] = False,
    ties: Annotated[
        str, typer.Option(help="interval of a spike at the instant (tfi, tau): before or after it")
    ] = "before",
    longest: Annotated[
        str | None,
        typer.Option(help="cycles of tau that become black, or 'auto' for the longest [255]"),
    ] = None,
    dark_limit: Annotated[
        float | None,
        typer.Option(help="cycles from which on an interval is noise, threshold / dark current"),
    ] = None,
    scale: Annotated[float, typer.Option(help="rate that becomes white")] = 1.0,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Write the image at an instant: round(255 clip(x / scale, 0, 1)), 8-bit grey, or x as .npy. A
    run that reads below threshold, or rejects the dark, has its dim pixels by that; with register
    writes x is in spikes of the nominal threshold."""
    import math
    from dataclasses import replace

    import numpy as np

    from cosim import InputError
    from cosim.archive import save_array
    from cosim.files import notes_of
    from cosim.files.atomic import atomic_write
    from cosim.report.png import to_linear_bytes, write_png
    from scenarios.assemble.source.latched.dim import dim_of_run, registers_in
    from sensor import isi, tau_levels
    from sensor.codec.files import open_any
    from sensor.reconstruct import METHODS, reconstruct
    from sensor.reconstruct.catalogue import TAU, check_ties
    from sensor.reconstruct.intervals import interval_span
    from sensor.reconstruct.readings import DimLight

    known = (*METHODS, TAU)
    if method not in known:
        raise InputError("--method", f"one of {', '.join(known)}", repr(method), "choose one")
    held = check_ties(ties, method)
    check_figure(out, ".png", ".npy", option="--out")
    for option, value, remedy in (
        ("--scale", scale, "write the white_rate of the run"),
        ("--dark-limit", dark_limit, "leave it out for that of the run"),
    ):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(option, "a number above 0", f"{value:g}", remedy)
    if longest is not None and method != TAU:
        raise InputError("--longest", "given with --method tau", f"with {method}", "leave it out")
    if longest not in (None, "auto") and not (longest.isdecimal() and int(longest) > 0):
        raise InputError(
            "--longest",
            "a number of cycles above 0, or auto",
            repr(longest),
            "leave it out for 255",
        )
    opened, notes = open_any(stream, size_option(size))
    light = dim_of_run(stream)
    if dark_limit is not None:
        light = replace(light or DimLight(), dark=dark_limit)
    black, used, plain, one_sided = None, None, None, None
    values: Any
    if method == TAU:
        span = interval_span(opened, at, window, preceding=preceding)
        used = None if window is None or span is None else span[1] - span[0]
        values = isi(opened, at, span, held)
        # Readings are no intervals.
        dim = None if light is None else DimLight(dark=light.dark).at(opened, at)
        if dim is not None:
            values = np.where(dim.dark, 0, values)
        black = max(int(values.max(initial=0)), 1) if longest == "auto" else int(longest or 255)
        grey = tau_levels(values, black)
    else:
        if window is None:
            window = METHODS[method].window
        made = reconstruct(
            opened, method, at, window, preceding=preceding, ties=held, dim_light=light,
            registers=registers_in(opened, stream),
        )  # fmt: skip
        values, dim, used, plain, one_sided = (
            made.rate, made.dim, made.cycles, made.plain, made.one_sided
        )  # fmt: skip
        grey = to_linear_bytes(values, scale)
    if out.suffix.lower() == ".npy":
        with atomic_write(out) as part, part.open("wb") as file:
            save_array(file, values)
    else:
        write_png(out, grey)
    for note in (*notes, *notes_of(opened)):
        SilentProgress().note(note)
    if json:
        print_document(
            {
                "stream": str(stream), "out": str(out), "method": method, "at": at,
                "window": window, "window_cycles": used,
                "preceding": None if method == "motion-tfp" else preceding, "longest": black,
                "ties": held if method == TAU or METHODS[method].ties else None,
                "sub_threshold_pixels": None if dim is None else int(dim.read.sum()),
                "dark_pixels": None if dim is None else int(dim.dark.sum()),
                "plain_pixels": plain, "one_sided_pixels": one_sided,
                "scale": None if method == TAU else scale,
                "cycles": opened.cycles, "height": opened.shape[0], "width": opened.shape[1],
            }
        )  # fmt: skip
