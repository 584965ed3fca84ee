"""`viform convert`: converts a stream to another format or to a video clip."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Annotated

import typer

from cosim.run.shown import make_progress
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, size_option, tell

FORMATS_HELP = ".dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl"


@dataclass(frozen=True)
class ClipOptions:
    """Options for writing a clip; the help texts describe them."""

    window: Annotated[
        int | None, typer.Option(help="clip: window of a tfp image, odd number of cycles [41]")
    ] = None
    every: Annotated[int | None, typer.Option(help="clip: cycles between images [20]")] = None
    scale: Annotated[float | None, typer.Option(help="clip: rate that becomes white [1]")] = None
    rate: Annotated[float | None, typer.Option(help="clip: images per second [25]")] = None


@dataclass(frozen=True)
class CodeOptions:
    """Options for writing a first-spike or packet file; the help texts describe them."""

    code: Annotated[
        str | None,
        typer.Option(
            help=".fsc: line or repeat (lossless), or statistical; .vfl: layered, raw, "
            "first-spike, statistical or event"
        ),
    ] = None
    k: Annotated[
        float | None, typer.Option("--k", help="statistical: limit of a change, in RSDs")
    ] = None
    threshold: Annotated[
        str | None, typer.Option(help="statistical: threshold, such as '1000 e'")
    ] = None
    threshold_noise: Annotated[
        str | None, typer.Option(help="statistical: threshold noise, such as '5 e'")
    ] = None
    refine: Annotated[
        int | None, typer.Option(help="statistical: intervals in the mean after a change")
    ] = None
    layers: Annotated[
        int | None, typer.Option(help=".vfl, layered: layers to keep; 8, all of them, lose nothing")
    ] = None
    cycles: Annotated[int | None, typer.Option(help=".vfl: cycles in a packet [128]")] = None


@expand_options
def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            help=f"{FORMATS_HELP}, the folder of a run, or a config.yaml or its folder",
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help=f"{FORMATS_HELP}, or a clip (.mp4)")],
    clip: ClipOptions,
    coding: CodeOptions,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    head: Annotated[
        bool, typer.Option("--head", help=".dat: write 400x250 as 416x250, with head")
    ] = False,
    config: Annotated[
        bool, typer.Option("--config", help=".dat: also write a config.yaml in its folder")
    ] = False,
    json: Json = False,
) -> None:
    """Convert a stream to another format, or render it as a clip in slow motion.

    Notes on standard error name the data that the new format cannot hold.
    """
    from cosim import InputError
    from cosim.config.amounts import count
    from cosim.files import FORMATS, ending_of, locate_stream, losses, notes_of, write_stream
    from cosim.spikes.staged import ToldStream
    from scenarios.assemble.source.latched.dim import said_by_run
    from sensor.codec.files import choose_code, is_coded, left, open_any, write_coded
    from sensor.reconstruct.clip import CLIPS, write_clip

    if source.suffix.lower() in CLIPS:
        raise InputError(
            "IN", f"a stream ({FORMATS_HELP})", f"the clip {source}",
            f"film it: viform run film --set scene.path={source}",
        )  # fmt: skip
    is_clip = out.suffix.lower() in CLIPS
    if not (is_clip or is_coded(out) or ending_of(out) in FORMATS):
        raise InputError(
            "OUT", f"a name ending in {FORMATS_HELP}, or of a clip ({', '.join(CLIPS)})", str(out),
            "give it one of these",
        )  # fmt: skip
    chosen = {name: value for name, value in asdict(clip).items() if value is not None}
    if chosen and not is_clip:
        flag = f"--{next(iter(chosen))}"
        raise InputError(flag, "given with a clip to write", str(out), f"leave {flag} out")
    place = source if is_coded(source) else locate_stream(source)
    if out.exists() and place.resolve() == out.resolve():
        raise InputError("OUT", "another file than IN", str(out), "choose another name")
    if (head or config) and out.suffix.lower() != ".dat":
        flag = "--head" if head else "--config"
        raise InputError(flag, "given with a .dat to write", str(out), f"leave {flag} out")
    coded = choose_code(out, *astuple(coding))
    pixels = size_option(size)
    lost: list[str] = []
    replaced = out.exists()
    progress = make_progress()
    try:
        opened, notes = open_any(source, pixels)
        said = said_by_run(source)
        if said is not None:
            opened = ToldStream(opened, said.told(opened))
        if is_clip:
            defaults = {"window": 41, "every": 20, "scale": 1.0, "rate": 25.0}
            write_clip(opened, out, **(defaults | chosen), progress=progress)
        elif coded is not None:
            write_coded(opened, out, coded)
            lost = losses(opened, out, ending_of(out))
            if not coded.lossless:
                lost.append(f"{out} holds only {left(coded)}")
        else:
            lost = write_stream(opened, out, head=head, config=config)
    finally:
        progress.close()
    for note in (*notes, *notes_of(opened), *lost):
        progress.note(note)
    if json:
        print_document(
            {"in": str(source), "out": str(out), "cycles": opened.cycles,
             "height": opened.shape[0], "width": opened.shape[1], "clock_hz": opened.clock.hz}
        )  # fmt: skip
        return
    height, width = opened.shape
    tell(
        f"{out}: {count(opened.cycles)} cycles of {width} x {height}"
        f"{', in place of an earlier one' if replaced else ''}"
    )
