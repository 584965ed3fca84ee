"""What is known before a board exists: the folder that builds its Verilog for an FPGA (`viform
board gateware`), and what links carry of a pixel array, raw and coded (`links`)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import amount, number
from cosim.run.shown import SilentProgress, make_progress
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from rtl_model.gateware import Design, Fit

_IP, _MAC = "192.168.1.50", "10:e2:d5:00:00:01"  # of a board that is given none
_CODES = ("first-spike", "layered")  # the lossless ones


@dataclass(frozen=True)
class BuildOptions:
    """Options of the build."""

    rows: Annotated[int, typer.Option(min=1, max=4095, help="rows of pixels")] = 32
    columns: Annotated[int, typer.Option(min=1, max=4096, help="columns of pixels")] = 32
    lanes: Annotated[int, typer.Option(help="pixels computed in a clock, 32 or 64")] = 32
    baud: Annotated[
        int | None,
        typer.Option(min=1, max=12_000_000, help="baud of the serial line", show_default="115200"),
    ] = None


@expand_options
def board_gateware(
    build: BuildOptions,
    target: Annotated[
        str | None, typer.Argument(metavar="TARGET", help="name of a board, from --list")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="new or empty folder to write")
    ] = None,
    cells: Annotated[
        bool,
        typer.Option("--cells", help="count cells with yosys; write only a build that fits"),
    ] = False,
    ethernet: Annotated[
        str | None,
        typer.Option(
            metavar="PHY",
            help="Ethernet by LiteEth instead of the serial line; --list names the PHYs",
        ),
    ] = None,
    ip: Annotated[
        str | None, typer.Option(help=f"IPv4 address with --ethernet, {_IP} when absent")
    ] = None,
    mac: Annotated[
        str | None, typer.Option(help=f"Ethernet address with --ethernet, {_MAC} when absent")
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="list the supported boards")] = False,
    json: Json = False,
) -> None:
    """Write a folder in which `make` builds the bitstream for a board."""
    from cosim import InputError
    from rtl_model.gateware import (
        check_folder,
        design_for,
        ethernet_named,
        fit,
        network,
        target_named,
        write_folder,
    )

    if listing:
        _list(json)
        return
    if target is None or out is None:
        missing = "TARGET" if target is None else "--out DIR"
        raise InputError(
            missing, "given", "absent",
            "write viform board gateware TARGET --out DIR; --list names the targets",
        )  # fmt: skip
    if build.lanes not in (32, 64):
        raise InputError("--lanes", "32 or 64", str(build.lanes), "choose one")
    board = target_named(target)
    wire: dict[str, Any] = {}
    if ethernet is None and (ip is not None or mac is not None):
        raise InputError(
            "--ip and --mac", "given with --ethernet PHY", "without",
            "leave them out, or name a PHY of --list",
        )  # fmt: skip
    if ethernet is not None:
        addresses = network(_IP if ip is None else ip, _MAC if mac is None else mac)
        wire = {"ethernet": ethernet_named(target, ethernet), "network": addresses}
        if build.baud is not None:
            raise InputError(
                "--baud", "left out with --ethernet", "given", "Ethernet replaces the serial line"
            )
        if cells:
            raise InputError(
                "--cells", "left out with --ethernet", "given", "LiteEth's core is made by `make`"
            )
    design = design_for(board, **asdict(replace(build, baud=build.baud or 115_200)), **wire)
    check_folder(out)
    counted = None
    if cells:
        SilentProgress().note("counting cells with yosys, which takes about a minute")
        counted = fit(design)
    ok = counted is None or counted.ok
    files = write_folder(design, out) if ok else []
    if json:
        print_document(_document(design, files, counted))
    else:
        tell(*_text(design, out, files, counted))
    if not ok:
        raise typer.Exit(1)


def _list(json: bool) -> None:
    from rtl_model.gateware import ETHERNET, TARGETS

    phys = {name: [one.name for one in ETHERNET.get(name, ())] for name in TARGETS}
    if json:
        rows = [
            {
                "target": one.name, "board": one.board, "family": one.device.family,
                "part": one.part, "clock_hz": one.clock_hz, "luts": one.device.luts,
                "flip_flops": one.device.flip_flops, "block_rams": one.device.block_rams,
                "ethernet": phys[one.name],
            }
            for one in TARGETS.values()
        ]  # fmt: skip
        print_document({"ok": True, "targets": rows})
        return
    for one in TARGETS.values():
        tell(
            f"{one.name:<16} {one.part:<19} {one.clock_hz / 1e6:g} MHz  {one.board}"
            + (f", Ethernet {', '.join(phys[one.name])}" if phys[one.name] else "")
        )


def _document(design: Design, files: list[str], cells: Fit | None) -> dict[str, object]:
    target = design.target
    return {
        "ok": cells is None or cells.ok,
        "target": target.name,
        "family": target.device.family,
        "part": target.part,
        "clock_hz": design.geometry.clock_hz,
        "baud": design.geometry.baud,
        "baud_error": design.baud_error,
        "geometry": design.geometry._asdict(),
        "build": f"{design.build:08x}",
        "files": files,
        "cells": None if cells is None else cells._asdict(),
        "ethernet": None if design.ethernet is None else design.ethernet.name,
        "ip": None if design.network is None else design.network.ip,
    }


def _text(design: Design, out: Path, files: list[str], cells: Fit | None) -> list[str]:
    target, size = design.target, design.geometry
    lines = [
        f"target     {target.board}, {target.part}",
        f"board      {size.rows} rows x {size.columns} columns, {size.lanes} lanes, "
        f"{size.clock_hz / 1e6:g} MHz, a tick of "
        f"{number(size.clock_hz / size.tick_clocks / 1e3, 4)} kHz",
        f"memories   capture {size.capture_words} words, sink {size.sink_words} words",
        f"serial     {size.baud} baud, off by {100 * design.baud_error:+.2f} %"
        if design.ethernet is None or design.network is None
        else f"ethernet   {design.ethernet.connector}, {design.network.ip}",
        f"build      {design.build:08x}",
    ]
    if cells is not None:
        for name in ("luts", "flip_flops", "block_rams"):
            used, available = getattr(cells, name), getattr(cells, f"{name}_of")
            lines.append(f"{name:<10} {used} of {available}, {100 * used / available:.0f} %")
    if not files:
        lines.append(f"{target.part} is too small: nothing was written")
        return lines
    lines += [
        f"written    {len(files)} files in {out}",
        f"try        make -C {out} && make -C {out} program",
        "then       viform board bringup --port "
        + (
            f"/dev/ttyUSB0 --baud {size.baud}"
            if design.network is None
            else f"udp:{design.network.ip}"
        ),
    ]
    return lines


def board_links(
    streams: Annotated[
        list[Path] | None,
        typer.Argument(metavar="STREAM", help="recording on which the codes are measured"),
    ] = None,
    size: Annotated[str, typer.Option(help="columns and rows of the array, WxH")] = "1000x1000",
    clock: Annotated[str, typer.Option(help="planes a second")] = "40 kHz",
    json: Json = False,
) -> None:
    """Say which share of a pixel array's spikes each link carries, raw and in the lossless codes.

    A share of 1 is every plane. The bits per pixel and cycle of a code are those of the recordings,
    headers of packets included.
    """
    from cosim import InputError
    from cosim.config.quantity import Quantity
    from rtl_model.stream.links import LINKS, raw_rate
    from sensor.codec.files import open_any
    from sensor.codec.packets.catalogue import StreamCode
    from sensor.codec.packets.coder import size_of, to_packets

    columns, rows = size_option(size) or (1000, 1000)
    try:
        hz = Quantity("frequency", above=0, most=1e9).read(clock)
    except ValueError as exc:
        must = str(exc).removeprefix("must be ")
        raise InputError("--clock", must, repr(clock), "write --clock '20 kHz'") from None
    raw = raw_rate(rows, columns, hz)
    coded: list[dict[str, object]] = []
    bits = {"raw": 1.0}
    progress = make_progress()
    try:
        opened = [(path, *open_any(path, None)) for path in streams or ()]  # all, before any coding
        names = [path.name for path, _, _ in opened]
        for path, stream, notes in opened:
            for note in notes:
                progress.note(note)
            for kind in _CODES:
                progress.note(f"coding {path} as {kind}")
                measured = size_of(to_packets(stream, StreamCode(kind)), stream)
                coded.append({"stream": str(path), "code": kind, "bits": measured})
                bits[f"{path if names.count(path.name) > 1 else path.name} {kind}"] = measured
    finally:
        progress.close()
    shares = {
        link.name: {name: min(1.0, link.rate / (raw * each)) for name, each in bits.items()}
        for link in LINKS
    }
    if json:
        links = [
            {"link": link.name, "bit_per_s": link.rate, "source": link.source,
             "planes_per_s": link.rate / (rows * columns), "shares": shares[link.name]}
            for link in LINKS
        ]  # fmt: skip
        print_document(
            {"rows": rows, "columns": columns, "clock_hz": hz, "raw_bit_per_s": raw,
             "coded": coded, "links": links}
        )  # fmt: skip
        return
    tell(f"{rows} x {columns} pixels at {amount(hz, 'Hz')}: {amount(raw, 'bit/s', 4)}")
    print()
    tell("| link | Mbit/s |" + "".join(f" {name} |" for name in bits))
    tell("|---|---|" + "---|" * len(bits))
    tell("| bits per pixel and cycle | |" + "".join(f" {each:.3f} |" for each in bits.values()))
    for link in LINKS:
        cells = "".join(f" {number(share)} |" for share in shares[link.name].values())
        tell(f"| {link.name} | {number(link.rate / 1e6, 4)} |{cells}")
