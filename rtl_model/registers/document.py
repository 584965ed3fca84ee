"""Generates docs/registers.md from the register map.

Command: `python -m rtl_model.registers.document > docs/registers.md`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rtl_model.geometry import Geometry
from rtl_model.registers.table import MEMORIES, PARAMETERS, REGISTERS, Register, parameters

_HEAD = """\
# Registers of the board

Generated from `rtl_model/registers/table.py` by `python -m rtl_model.registers.document`. Do not
edit.

A register is one word of 32 bits. Addresses are in bytes. On the line (LiteX uartbone) an address
is counted in words, so 0x300 is sent as 0xC0. Bits beyond a register's width read 0. A register
marked **reads once** changes when it is read, so a read must not be repeated. `wo` registers read
0. The value after reset is a number or a parameter of the build, listed at the end.
"""


def _row(register: Register) -> list[str]:
    reset = register.reset if isinstance(register.reset, str) else f"0x{register.reset:x}"
    text = register.text + ("; **reads once**" if register.read_effect else "")
    cells = [f"0x{register.address:03x}", f"`{register.name}`", register.mode, str(register.width)]
    rows = [f"| {' | '.join([*cells, reset, text])} |"]
    for field in register.fields:
        bits = f"{field.high}:{field.low}" if field.high > field.low else f"{field.low}"
        rows.append(f"| | `.{field.name}` | | {bits} | | {field.text} |")
    return rows


def register_tables(registers: Sequence[Register], heading: str = "##") -> list[str]:
    """Lines of Markdown: a heading and a table for each group of registers."""
    lines: list[str] = []
    for group in dict.fromkeys(register.name.split("_")[0] for register in registers):
        lines += [
            f"{heading} {group}",
            "",
            "| address | name | mode | bits | reset | meaning |",
            "|---|---|---|---|---|---|",
        ]
        for register in registers:
            if register.name.split("_")[0] == group:
                lines += _row(register)
        lines.append("")
    return lines


def document() -> str:
    """The text of docs/registers.md."""
    values = parameters(Geometry())
    lines = [_HEAD, *register_tables(REGISTERS)]
    lines += [
        "## Memories",
        "",
        "| address | name | mode | bytes | meaning |",
        "|---|---|---|---|---|",
    ]
    for memory in MEMORIES:
        lines.append(
            f"| 0x{memory.address:06x} | `{memory.name}` | {memory.mode} | {memory.size} "
            f"| {memory.text} |"
        )
    lines += [
        "",
        "## Parameters of a build",
        "",
        f"Values are those of the default build: {Geometry().rows} x {Geometry().columns} pixels, "
        f"{Geometry().lanes} lanes, {Geometry().clock_hz} Hz, {Geometry().baud} baud.",
        "",
        "| name | meaning | value |",
        "|---|---|---|",
    ]
    for name, meaning in PARAMETERS.items():
        value = "of the build" if name == "BUILD" else f"{values[name]:#x}"
        if name not in ("GEOMETRY", "ALL_ROWS", "ALL_COLUMNS", "BUILD"):
            value = str(values[name])
        lines.append(f"| {name} | {meaning} | {value} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(document())
