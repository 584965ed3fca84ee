"""What stands behind the line of a board: its design (`viform board identify`), its registers by
name (`regs`), and the bit errors of the line in both directions (`prbs`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.config.amounts import count, elapsed
from rtl_model.bringup.bench.endpoint import VIRTUAL
from scenarios.cli.board.connection import BoardOptions, LineOptions, connect, known_map
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.host import CsrMap


@expand_options
def board_identify(
    options: LineOptions,
    json: Json = False,
) -> None:
    """Identify a Viform board or imager, with its size and build, or another LiteX design by its
    csr.csv."""
    from rtl_model.host import BoardInfo, Cause, LineFault

    with connect(options, json, recognise=True, confirm=False) as connection:
        board = connection.board
        rate = connection.baud
        has_name = "identifier_mem" in {*board.csr.bases, *board.csr.memories}
        identifier = board.identifier() if has_name else None
        document: dict[str, object] = {
            "ok": True, "port": connection.url, "baud": rate, "identifier": identifier,
        }  # fmt: skip
        try:
            info = board.imager_info() if board.csr.imager else board.info()
        except LineFault as fault:
            if fault.cause is not Cause.NOT_OURS or options.csr is None:
                raise
            document |= {"ours": False, "registers": len(board.csr.registers)}
        else:
            document |= {"ours": True, "registers": len(board.csr.registers)}
            found = info._asdict() | {"build": f"{info.build:08x}"}
            document |= {"board": found if rate else found | {"baud": None}}
            if isinstance(info, BoardInfo) and info.build_matches is not None:
                document |= {"build_matches": info.build_matches}
    if json:
        print_document(document)
        return
    line = "" if rate is None else f", {rate} baud"
    tell(f"{'port':<14} {document['port']}{line}")
    tell(f"{'identifier':<14} {identifier or 'none'}")
    board_rows = document.get("board")
    if isinstance(board_rows, dict):
        for name, value in board_rows.items():
            if value is None:  # baud, over UDP
                continue
            tell(f"{name:<14} {value:#x}" if name == "version" else f"{name:<14} {value}")
        if "build_matches" in document:
            origin = "this program's" if document["build_matches"] else "not this program's"
            tell(f"{'verilog':<14} {origin}, by the build's CRC-32")
    else:
        tell(f"{'design':<14} foreign, {document['registers']} registers in its csr.csv")


@expand_options
def board_regs(
    options: LineOptions,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME", help="registers to read; all without read effect if none"),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="register to write before"),
    ] = None,
    listing: Annotated[
        bool, typer.Option("--list", help="names and addresses only, without a board")
    ] = False,
    json: Json = False,
) -> None:
    """List, read and write registers of a Viform board or imager, or of any LiteX design by its
    csr.csv."""
    from cosim import InputError
    from rtl_model.host import default_map

    writes = [assignment(text) for text in assignments or ()]
    if listing and (writes or options != LineOptions(csr=options.csr)):
        raise InputError(
            "--set and the options of the line", "left out with --list", "given",
            "leave them out, because --list needs no board",
        )  # fmt: skip
    known = known_map(options.csr)
    if known is None and (listing or options.port == VIRTUAL):
        known = default_map()
    if known is not None:  # refuses unknown names before the connection
        rows = _rows(known, names, writes)
    if not listing:
        with connect(options, json, recognise=True) as connection:
            board = connection.board
            rows = _rows(board.csr, names, writes)
            for name, number in writes:
                board.write(name, number)
            for row in rows:
                entry = board.csr.table.get(row["name"])
                # Without names, registers with a read effect are not read.
                effect = entry is not None and entry.read_effect and not names
                unread = row["mode"] == "wo" or effect
                row["value"] = None if unread else board.read(row["name"])
                row["fields"] = {} if unread or entry is None else _fields(entry, row["value"])
    if json:
        print_document({"ok": True, "registers": rows})
        return
    for row in rows:
        value: Any = row.get("value")
        text = "" if listing else ("-" if value is None else f"{value:#010x}")
        fields = row.get("fields") or {}
        assert isinstance(fields, dict)
        more = ", ".join(f"{name} {field}" for name, field in fields.items())
        tell(
            f"{row['address']:#07x} {row['mode']} {row['name']:<22} {text:<11}"
            f"{more or row['text']}".rstrip()
        )


def _rows(
    known: CsrMap, names: list[str] | None, writes: list[tuple[str, int]]
) -> list[dict[str, Any]]:
    """Name, address, mode and text of each requested register.

    Raises InputError for an unknown name.
    """
    for name in [*(names or ()), *(name for name, _ in writes)]:
        known.register(name)
    chosen = list(names or ([name for name, _ in writes] if writes else known.registers))
    table = known.table
    return [
        {"name": name, "address": known.registers[name].address,
         "mode": table[name].mode if name in table else known.registers[name].mode,
         "text": table[name].text if name in table else ""}
        for name in chosen
    ]  # fmt: skip


def assignment(text: str) -> tuple[str, int]:
    """Name and value of `NAME=VALUE`. Raises InputError for another text."""
    from cosim import InputError

    name, equals, value = text.partition("=")
    try:
        if not equals or len(value) > 40:
            raise ValueError
        number = int(value.strip(), 0)
    except ValueError:
        raise InputError(
            "--set", "NAME=VALUE such as sensor_threshold=3", repr(text[:60]), "write it so"
        ) from None
    if number < 0:
        raise InputError(f"--set {name}", "0 or more", value, "give the bits as a number")
    return name.strip(), number


def _fields(entry: Any, value: int) -> dict[str, int]:
    return {
        field.name: value >> field.low & ((1 << (field.high - field.low + 1)) - 1)
        for field in entry.fields
    }


@expand_options
def board_prbs(
    options: BoardOptions,
    order: Annotated[
        list[int] | None, typer.Option(help="7, 15, 23 or 31, repeatable; all when absent")
    ] = None,
    words: Annotated[
        int,
        typer.Option(min=1, max=10_000_000, help="32-bit words in each direction, for each order"),
    ] = 1024,
    json: Json = False,
) -> None:
    """Count wrong bits of pseudo-random words to and from the board. Exit 1 if there are any."""
    from rtl_model.host import prbs

    with connect(options, json) as connection:
        reports = [prbs.check(connection.board, one, words) for one in order or prbs.ORDERS]
    clean = all(report.clean for report in reports)
    if json:
        rows = [report._asdict() | {"clean": report.clean} for report in reports]
        print_document({"ok": clean, "orders": rows})
    else:
        for report in reports:
            tell(
                f"order {report.order:>2}: {count(32 * report.words)} bits in each direction, "
                f"{report.bits_wrong_from_board} wrong from the board, "
                f"{report.bits_wrong_to_board} to the board, "
                f"{report.words_lost_to_board} words lost, {report.faults} answers interrupted, "
                f"{elapsed(report.seconds)}"
            )
    if not clean:
        raise typer.Exit(1)
