"""Stage identity: checks that the board runs the Viform design, and reads its build and size."""

from __future__ import annotations

from cosim import InputError
from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Cause, LineFault
from rtl_model.registers import MAGIC, VERSION, identifier

_MOST_ROWS, _MOST_COLUMNS = 4095, 4096


def check_identity(bench: Bench) -> Figures:
    """Reads magic, version, geometry, build and identifier into `bench.geometry` and `bench.board`.

    Raises StageFault foreign, version, geometry or identifier.
    """
    board = Board(bench.bone, bench.csr)
    if not bench.csr.is_viform_board:
        raise _foreign(board, "the csr.csv does not describe a Viform board")
    magic = bench.read_stable("ctrl_magic")
    if magic != MAGIC:
        raise _foreign(board, f"the first register reads {magic:#010x}, not {MAGIC:#010x}")
    version = bench.read_stable("ctrl_version")
    if version >> 16 != VERSION >> 16:
        raise StageFault(
            "version",
            f"the board's register map is {version >> 16}.{version & 0xFFFF}, "
            f"this program's {VERSION >> 16}.{VERSION & 0xFFFF}",
            "load a board of this program's version, or use the program of the board's",
            {"version": f"{version:#010x}"},
        )
    info = board.info()
    geometry = info.geometry
    figures: Figures = {
        "version": f"{version >> 16}.{version & 0xFFFF}",
        "build": f"{info.build:08x}",
        "rows": info.rows,
        "columns": info.columns,
        "lanes": info.lanes,
        "clock_hz": info.clock_hz,
        "board_baud": info.baud,
        "capture_words": info.capture_words,
        "sink_words": info.sink_words,
    }
    _check_geometry(geometry, figures)
    text = board.identifier()
    figures["identifier"] = text
    if text != identifier(geometry):
        raise StageFault(
            "identifier",
            f"the board's identifier is {text!r}, its geometry {info.rows} x {info.columns}",
            "rebuild the board: its header and parameters are of different builds",
            figures,
        )
    minimum = bench.read_stable("sensor_tick_minimum")
    if minimum != geometry.tick_minimum:
        raise StageFault(
            "geometry",
            f"sensor_tick_minimum reads {minimum}, where {geometry.tick_minimum} follow from "
            "the geometry",
            "rebuild the board: its header and parameters are of different builds",
            figures,
        )
    figures["build_matches"] = info.build_matches
    bench.geometry = geometry
    bench.board = {**figures}
    return figures


def _check_geometry(size: Geometry, figures: Figures) -> None:
    fine = (
        1 <= size.rows <= _MOST_ROWS
        and 1 <= size.columns <= _MOST_COLUMNS
        and size.lanes in (32, 64)
        and size.clock_hz > 0
        and size.capture_words > 0
        and not size.capture_words & (size.capture_words - 1)
    )
    if not fine:
        raise StageFault(
            "geometry",
            f"the board states {size.rows} x {size.columns} pixels in {size.lanes} lanes, a clock "
            f"of {size.clock_hz} Hz and a memory of {size.capture_words} words",
            "load a build with valid parameters",
            figures,
        )


def _foreign(board: Board, observation: str) -> StageFault:
    """The fault of another design, with its name if it has LiteX's identifier."""
    figures: Figures = {}
    name = ""
    try:
        text = board.identifier().rstrip("?").strip()
    except InputError:  # no such memory in its csr.csv
        text = ""
    except LineFault as fault:  # no answer at that address
        if fault.cause in (Cause.GONE, Cause.STUCK, Cause.DIFFERS):
            raise
        text = ""
    if text and "?" not in text:
        figures["identifier"] = text
        name = f"; its identifier is {text!r}"
    return StageFault(
        "foreign",
        f"another design answers: {observation}{name}",
        "load the Viform board, or read this one by name with `viform board regs --csr FILE`",
        figures,
    )
