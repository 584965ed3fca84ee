"""`viform convert`: a stream from one format to another, or to a clip to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.commands.output import Json, make_progress, print_document, size_option

__all__ = ["convert"]


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help=".dat, .npz, .zarr or a run's folder")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help=".dat, .npz, .zarr, or a clip (.mp4)")],
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    window: Annotated[int, typer.Option(help="of a clip: cycles of each tfp image, odd")] = 41,
    every: Annotated[int, typer.Option(help="of a clip: cycles from image to image")] = 20,
    scale: Annotated[float, typer.Option(help="of a clip: rate that becomes white")] = 1.0,
    rate: Annotated[float, typer.Option(help="of a clip: images a second")] = 25.0,
    json: Json = False,
) -> None:
    """Convert a stream between formats, or render it as a clip in slow motion."""
    from cosim import InputError
    from cosim.files import FORMATS, open_stream, write_stream
    from scenarios.playback import CLIPS, write_clip

    if source.exists() and out.exists() and source.resolve() == out.resolve():
        raise InputError("OUT", "another file than IN", str(out), "choose another name")
    if source.suffix.lower() in CLIPS:
        raise InputError(
            "IN", f"a stream ({', '.join(FORMATS)})", f"the clip {source}",
            f"film it: viform run film --set scene.path={source}",
        )  # fmt: skip
    opened = open_stream(source, size_option(size))
    progress = make_progress()
    try:
        if out.suffix.lower() in CLIPS:
            write_clip(
                opened, out, window=window, every=every, scale=scale, rate=rate, progress=progress
            )
        else:
            write_stream(opened, out)
    finally:
        progress.close()
    if json:
        print_document(
            {"in": str(source), "out": str(out), "cycles": opened.cycles,
             "height": opened.shape[0], "width": opened.shape[1], "clock_hz": opened.clock.hz}
        )  # fmt: skip
