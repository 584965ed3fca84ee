"""`viform board capture`: captures frames from a board into a stream file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.config.amounts import number
from scenarios.cli.board.connection import BoardOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["board_capture"]


@expand_options
def board_capture(
    options: BoardOptions,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="STREAM", help="file to write: .zarr, .npz, .events.npz, .dat or .raw"
        ),
    ],
    frames: Annotated[int, typer.Option(min=1, help="in the captured burst")] = 8,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="register to write before"),
    ] = None,
    clear: Annotated[
        bool, typer.Option("--clear", help="begin with frame 0 and without charge")
    ] = False,
    layout: Annotated[
        str | None,
        typer.Option(
            "--format", help="spikecv: a .dat, and beside it the config.yaml that SpikeCV reads"
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Capture a burst and write it as a stream. Every row is verified by number and CRC-32."""
    from cosim import InputError, Viform
    from cosim.files import FORMATS, ending_of, write_stream
    from cosim.files.config_yaml import check_config, write_config
    from rtl_model.bringup.bench.frames import frame_clock
    from rtl_model.host import capture
    from scenarios.cli.board.regs import assignment

    if ending_of(out) not in FORMATS:
        must = f"a name ending in {', '.join(FORMATS)}"
        raise InputError("--out", must, str(out), "give it one of these")
    if layout not in (None, "spikecv"):
        raise InputError("--format", "spikecv", layout, "correct it, or leave it out")
    if layout is not None and ending_of(out) != ".dat":
        raise InputError(
            "--out", "a name ending in .dat with --format spikecv", str(out),
            "rename it, or leave --format out",
        )  # fmt: skip
    writes = [assignment(text) for text in assignments or ()]
    progress = make_progress()
    try:
        with connect(options, json) as connection:
            if layout is not None:
                info = connection.board.info()
                check_config(out, (info.columns, info.rows))
            for name, value in writes:
                connection.board.write(name, value)
            captured = capture.burst(connection.board, frames, clear=clear)
            clock = frame_clock(connection.board)
        stream = Viform.from_planes(captured.planes, clock)
        if layout is not None:  # before the planes, whose size it tells
            write_config(out, stream.shape[::-1], whole_set=True)
        lost = write_stream(stream, out)
        for text in lost:
            progress.note(text)
    finally:
        progress.close()
    height, width = stream.shape
    document: dict[str, Any] = {
        "ok": True, "file": str(out), "frames": stream.cycles,
        "first_frame": int(captured.frames[0]), "width": width, "height": height,
        "clock_hz": clock.hz, "lost_rows": captured.lost, "retries": captured.retries,
        "bytes": captured.bytes, "seconds": captured.seconds,
        "bytes_per_s": captured.bytes / max(captured.seconds, 1e-9),
    }  # fmt: skip
    if json:
        print_document(document)
        return
    for name in ("frames", "width", "height", "clock_hz", "retries", "bytes", "bytes_per_s"):
        value = document[name]
        print(f"{name:<12} {number(value)}")
    print(f"{'written':<12} {out}")
