"""`viform board capture`: captures frames from a board into a stream file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import number
from cosim.run.shown import SilentProgress, make_progress
from scenarios.cli.board.connection import BoardOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.host import Captured


@expand_options
def board_capture(
    options: BoardOptions,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="STREAM", help="file to write: .zarr, .npz, .events.npz, .dat or .raw"
        ),
    ],
    frames: Annotated[
        int | None, typer.Option(min=1, help="frames in the captured burst", show_default="8")
    ] = None,
    levels: Annotated[
        int | None,
        typer.Option(
            help="read the charges in so many levels of the threshold, a power of two up to 128, "
            "in place of a burst; --out is then an .npz"
        ),
    ] = None,
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
    """Capture a burst and write it as a stream, or read the charges. Every row is verified by
    number and CRC-32."""
    if levels is not None:
        _read(options, out, levels, assignments, (frames, clear or None, layout), json)
        return
    from cosim import InputError, Viform
    from cosim.files import FORMATS, ending_of, write_stream
    from cosim.files.config_yaml import check_config, write_config
    from rtl_model.bringup.bench.frames import frame_clock
    from rtl_model.host import capture
    from scenarios.cli.board.line import assignment

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
            captured = capture.burst(connection.board, frames or 8, clear=clear)
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
    _print({
        "ok": True, "file": str(out), "frames": stream.cycles,
        "first_frame": int(captured.frames[0]), "width": width, "height": height,
        "clock_hz": clock.hz, **_drained(captured),
    }, json)  # fmt: skip


def _read(
    options: BoardOptions,
    out: Path,
    levels: int,
    assignments: list[str] | None,
    others: tuple[object, ...],
    json: bool,
) -> None:
    """Reads the charges and writes their levels."""
    import numpy as np

    from cosim import InputError
    from rtl_model.host import check_levels, read_charges
    from scenarios.cli.board.line import assignment
    from sensor.reconstruct.readings import Readings, write_readings

    if any(other is not None for other in others):
        raise InputError(
            "--frames, --clear and --format", "left out with --levels", "given",
            "leave them out, because a reading is no burst",
        )  # fmt: skip
    check_levels(levels, "--levels")
    if out.suffix.lower() != ".npz":
        raise InputError("--out", "a name ending in .npz with --levels", str(out), "rename it")
    with connect(options, json) as connection:
        for name, value in [assignment(text) for text in assignments or ()]:
            connection.board.write(name, value)
        reading = read_charges(connection.board, levels)
    if not reading.frames:
        SilentProgress().note(
            "no frame began since the sensor was cleared, so every charge is 0; "
            "--set sensor_run=1 runs it"
        )
    cycle = np.array([reading.frames], np.int64)
    write_readings(Readings(cycle, reading.level[None], levels), out)
    height, width = reading.level.shape
    _print({
        "ok": True, "file": str(out), "levels": levels, "frames": reading.frames,
        "width": width, "height": height, **_drained(reading.captured),
    }, json)  # fmt: skip


def _drained(captured: Captured) -> dict[str, Any]:
    """What the host says of a drained memory."""
    return {
        "lost_rows": captured.lost, "retries": captured.retries, "bytes": captured.bytes,
        "seconds": captured.seconds, "bytes_per_s": captured.bytes / max(captured.seconds, 1e-9),
    }  # fmt: skip


def _print(document: dict[str, Any], json: bool) -> None:
    if json:
        print_document(document)
        return
    hidden = ("ok", "file", "first_frame", "lost_rows", "seconds")
    for name, value in document.items():
        if name not in hidden:
            tell(f"{name:<12} {number(value)}")
    tell(f"{'written':<12} {document['file']}")
