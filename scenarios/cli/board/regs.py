"""`viform board regs`: lists, reads and writes registers by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtl_model.bringup.bench.endpoint import VIRTUAL
from scenarios.cli.board.connection import LineOptions, connect, known_map
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.host import CsrMap


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
