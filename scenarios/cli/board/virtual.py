"""`viform board virtual`: starts a simulated board behind a serial port."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.compute.stopping import said
from cosim.config.amounts import number
from cosim.run.shown import SilentProgress
from rtl_model.bringup.bench.endpoint import checked_level, virtual_board
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry
    from rtl_model.virtual import VirtualBoard
    from rtl_model.virtual.ethernet import EthernetBoard


@dataclass(frozen=True)
class BuildOptions:
    """Options of the simulated build."""

    rows: Annotated[
        int | None, typer.Option(min=1, max=4095, help="rows of pixels, 32 when absent")
    ] = None
    columns: Annotated[
        int | None, typer.Option(min=1, max=4096, help="columns of pixels, 32 when absent")
    ] = None
    lanes: Annotated[
        int | None, typer.Option(help="pixels computed in a clock, 32 (when absent) or 64")
    ] = None
    clock: Annotated[
        int | None,
        typer.Option(
            min=10_000,
            max=1_000_000_000,
            help="nominal clock of the board, Hz; when absent, one that a simulator reaches",
        ),
    ] = None


@expand_options
def board_virtual(
    build: BuildOptions,
    link: Annotated[Path | None, typer.Option(help="symbolic link to create for the port")] = None,
    imager: Annotated[
        str | None,
        typer.Option(
            help="simulate a conventional imager instead: adaptive-exposure, ebaps, emccd, "
            "hardware-chain, pwm or pfm, with its size and clock, at level model"
        ),
    ] = None,
    level: Annotated[
        str | None,
        typer.Option(
            help="bytes (the default), pins (with baud and noise), or model (no Verilator)"
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="fault to inject, repeatable: drop|flip|extra:rx|tx@N or %N, cut@N, "
            "power-cycle@N, silent, slow=MS, baud=PERCENT, noise=SHARE, stuck=ROW,COLUMN, foreign"
        ),
    ] = None,
    baud: Annotated[
        int | None,
        typer.Option(min=50, max=12_000_000, help="baud of the line", show_default="115200"),
    ] = None,
    udp: Annotated[
        str | None,
        typer.Option(
            metavar="HOST[:PORT]",
            help="serve Etherbone over UDP at this address instead of a pty, such as 127.0.0.1",
        ),
    ] = None,
    csr: Annotated[Path | None, typer.Option(help="csr.csv to write for host tools")] = None,
    json: Json = False,
) -> None:
    """Start a simulated board, or an imager's registers, behind a pty or over UDP until Ctrl-C."""
    from cosim import InputError
    from cosim.files.atomic import atomic_write
    from cosim.run.loop import end_requests
    from rtl_model.geometry import Geometry
    from rtl_model.host.ether import is_udp
    from rtl_model.registers import csr_csv
    from rtl_model.virtual import nominal_clock

    if build.lanes not in (None, 32, 64):
        raise InputError("--lanes", "32 or 64", str(build.lanes), "choose one")
    if udp is not None:
        if link is not None:
            raise InputError("--link", "left out with --udp", "given", "a pty has a link only")
        if baud is not None:
            raise InputError(
                "--baud", "left out with --udp", "given",
                "a network has none; --clock sets the board's clock",
            )  # fmt: skip
        udp = udp if is_udp(udp) else f"udp:{udp}"
    baud = baud or 115_200
    text, device = "", None
    if imager is not None:
        from imagers.catalogue import kind_of

        if build != BuildOptions():
            raise InputError(
                "--rows, --columns, --lanes and --clock", "left out with --imager", "given",
                "an imager has its own size and clock",
            )  # fmt: skip
        level = level or "model"
        device = kind_of(imager)
        design = device.design()
        geometry = design.geometry._replace(baud=baud)
        text = design.csr_csv()
    else:
        level = level or "bytes"
        clock = build.clock or nominal_clock(checked_level(level), baud)
        geometry = Geometry(build.rows or 32, build.columns or 32, build.lanes or 32, clock, baud)
    simulated = virtual_board(
        baud=baud,
        level=level,
        faults=fault,
        geometry=geometry,
        link=link,
        device=device,
        udp=udp,
    )
    if level != "model" and not json:
        SilentProgress().note("preparing the Verilog, which is compiled once for each geometry")
    with suppress(KeyboardInterrupt), simulated as board:
        if csr is not None:
            with atomic_write(csr) as part:
                part.write_text(text or csr_csv(geometry), encoding="utf-8")
        if json:
            print_document(_document(board, geometry, csr))
        else:
            tell(*_text(board, geometry, csr))
        sys.stdout.flush()
        board.wait(end_requests())
        said()


def _name(board: VirtualBoard | EthernetBoard) -> str | None:
    """Name of the imager that is served; None for a Viform board."""
    return None if board.device is None else board.device.name


def _document(
    board: VirtualBoard | EthernetBoard, geometry: Geometry, csr: Path | None
) -> dict[str, object]:
    return {
        "port": board.port,
        "level": board.level,
        "imager": _name(board),
        "geometry": geometry._asdict(),
        "csr": None if csr is None else str(csr),
        "clocks_per_second": round(board.clocks_per_second),
        "time_scale": round(board.time_scale, 2),
    }


def _text(board: VirtualBoard | EthernetBoard, geometry: Geometry, csr: Path | None) -> list[str]:
    from rtl_model.host.ether import is_udp

    lanes = f"{geometry.lanes} lanes, " if board.device is None else ""
    serial = not is_udp(board.port)
    lines = [
        f"port       {board.port}" + (f", {geometry.baud} baud" if serial else ", Etherbone"),
        f"{_name(board) or 'board':<10} {geometry.rows} rows x {geometry.columns} columns, {lanes}"
        f"{geometry.clock_hz / 1e6:g} MHz, level {board.level}",
        f"speed      {number(board.clocks_per_second / 1e6)} million clocks per second; a host "
        f"should wait {board.time_scale:.1f} times as long",
    ]
    if csr is not None:
        lines.append(f"csr        {csr}")
    command = "bringup" if board.device is None else "regs"
    rate = f" --baud {geometry.baud}" if serial else ""
    lines.append(f"try        viform board {command} --port {board.port}{rate}")
    lines.append("end        Ctrl-C")
    return lines
