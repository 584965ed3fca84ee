"""`viform board virtual`: a board that exists only as Verilog, behind a serial port."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenarios.board_port import known_level, virtual_board
from scenarios.commands.output import Json, SilentProgress, print_document

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry
    from rtl_model.virtual import VirtualBoard

__all__ = ["board_virtual"]


def board_virtual(
    link: Annotated[Path | None, typer.Option(help="a symlink to make for the port")] = None,
    level: Annotated[
        str, typer.Option(help="bytes, pins (baud and noise exist), or model (no Verilator)")
    ] = "bytes",
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="what is wrong with it, repeatable: drop|flip|extra:rx|tx@N or %N, cut@N, "
            "power-cycle@N, silent, slow=MS, baud=PERCENT, noise=SHARE, stuck=ROW,COLUMN, foreign"
        ),
    ] = None,
    rows: Annotated[int, typer.Option(min=1, max=4095, help="of pixels")] = 32,
    columns: Annotated[int, typer.Option(min=1, max=4096, help="of pixels")] = 32,
    lanes: Annotated[int, typer.Option(help="pixels a clock computes, 32 or 64")] = 32,
    clock: Annotated[
        int | None,
        typer.Option(
            min=10_000,
            max=1_000_000_000,
            help="nominal clock of the board, Hz; when absent, one that a simulator keeps up with",
        ),
    ] = None,
    baud: Annotated[int, typer.Option(min=50, max=12_000_000, help="of its line")] = 115_200,
    csr: Annotated[Path | None, typer.Option(help="a csr.csv to write for host tools")] = None,
    json: Json = False,
) -> None:
    """Start a board behind a pty and serve it until Ctrl-C."""
    from cosim import InputError
    from cosim.files.whole import whole
    from rtl_model.geometry import Geometry
    from rtl_model.registers import csr_csv
    from rtl_model.virtual import nominal_clock

    if lanes not in (32, 64):
        raise InputError("--lanes", "32 or 64", str(lanes), "choose one")
    clock = clock or nominal_clock(known_level(level), baud)
    geometry = Geometry(rows, columns, lanes, clock, baud)
    made = virtual_board(baud=baud, level=level, faults=fault, geometry=geometry, link=link)
    if level != "model" and not json:
        SilentProgress().note("preparing the Verilog, which is compiled once for each geometry")
    with suppress(KeyboardInterrupt), made as board:
        if csr is not None:
            with whole(csr) as part:
                part.write_text(csr_csv(geometry), encoding="utf-8")
        if json:
            print_document(_document(board, geometry, csr))
        else:
            print(_text(board, geometry, csr))
        sys.stdout.flush()
        board.wait()


def _document(board: VirtualBoard, geometry: Geometry, csr: Path | None) -> dict[str, object]:
    return {
        "port": board.port,
        "level": board.level,
        "geometry": geometry._asdict(),
        "csr": None if csr is None else str(csr),
        "clocks_per_second": round(board.clocks_per_second),
        "time_scale": round(board.time_scale, 2),
    }


def _text(board: VirtualBoard, geometry: Geometry, csr: Path | None) -> str:
    lines = [
        f"port       {board.port}, {geometry.baud} baud",
        f"board      {geometry.rows} rows x {geometry.columns} columns, {geometry.lanes} lanes, "
        f"{geometry.clock_hz / 1e6:g} MHz, level {board.level}",
        f"speed      {board.clocks_per_second / 1e6:.3g} million clocks a second; a host should "
        f"wait {board.time_scale:.1f} times as long",
    ]
    if csr is not None:
        lines.append(f"csr        {csr}")
    lines.append(f"try        viform board bringup --port {board.port} --baud {geometry.baud}")
    lines.append("end        Ctrl-C")
    return "\n".join(lines)
