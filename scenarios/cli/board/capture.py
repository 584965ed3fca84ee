"""`viform board capture`: frames from a board, as a stream in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

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
            "--out", metavar="STREAM", help="written: .zarr, .npz, .events.npz, .dat or .raw"
        ),
    ],
    frames: Annotated[int, typer.Option(min=1, help="to capture, in one burst")] = 8,
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="registers, before")
    ] = None,
    clear: Annotated[
        bool, typer.Option("--clear", help="begin with frame 0 and no charge")
    ] = False,
    json: Json = False,
) -> None:
    """Capture a burst and write it as a stream; every row is verified by sequence and CRC-32."""
    from cosim import InputError, Viform
    from cosim.files import FORMATS, ending_of, write_stream
    from rtl_model.bringup.bench.frames import frame_clock
    from rtl_model.host import capture
    from scenarios.cli.board.regs import assignment

    if ending_of(out) not in FORMATS:
        given, mend = str(out), "give it one of these"
        raise InputError("--out", f"a name ending in {', '.join(FORMATS)}", given, mend)
    writes = [assignment(text) for text in assignments or ()]
    progress = make_progress()
    try:
        with connect(options, json) as connection:
            for name, value in writes:
                connection.board.write(name, value)
            taken = capture.burst(connection.board, frames, clear=clear)
            clock = frame_clock(connection.board)
        stream = Viform.from_planes(taken.planes, clock)
        lost = write_stream(stream, out)
        for text in lost:
            progress.note(text)
    finally:
        progress.close()
    height, width = stream.shape
    document: dict[str, Any] = {
        "ok": True, "file": str(out), "frames": stream.cycles, "first_frame": int(taken.frames[0]),
        "width": width, "height": height, "clock_hz": clock.hz, "lost_rows": taken.lost,
        "retries": taken.retries, "bytes": taken.bytes, "seconds": taken.seconds,
        "bytes_per_s": taken.bytes / max(taken.seconds, 1e-9),
    }  # fmt: skip
    if json:
        print_document(document)
        return
    for name in ("frames", "width", "height", "clock_hz", "retries", "bytes", "bytes_per_s"):
        value = document[name]
        print(f"{name:<12} {value:.6g}" if isinstance(value, float) else f"{name:<12} {value}")
    print(f"{'written':<12} {out}")
