"""Writes docs/imager-registers.md from the register tables of the imagers:
`python -m imagers.document > docs/imager-registers.md`.
"""

from __future__ import annotations

import sys

from imagers.catalogue import IMAGERS
from rtl_model.registers.design import HEAD
from rtl_model.registers.document import register_tables

_HEAD = """\
# Registers of the imagers

This file is generated from the tables in `imagers` by
`python -m imagers.document`; do not edit it.

Every conventional imager has registers like those of the spike camera's board
([registers.md](registers.md)): 32-bit words behind LiteX's uartbone, the same common head at the
same addresses, and the identifier at 0x800. `viform board virtual --imager NAME` serves an imager
at a serial port. `viform board identify` and `viform board regs` access it like a board; the option
`--csr FILE` writes `csr.csv` for other tools. The registers of each kind of imager begin at 0x300.

A register reads back immediately what was written to it. The tables state when the sequencer uses
the new value: at once, with the next frame, or with the next cycle. All registers that wait for the
same instant are updated together. A write takes place one clock after the last byte of its word has
arrived; an operation that begins at that clock still uses the old value.

The serial line cannot refuse a write, as the hardware cannot. It drops bits beyond the width of a
register. A write to a read-only register has no effect, and a write to an unused address only
increments `ctrl_bus_errors`. (`viform board regs` checks the table before it writes, and refuses.)
`imager.writes` of a scenario, and `write` of an imager in Python, check the same table in every
imager. They refuse, with a one-line error, an unknown or read-only register, a value with too many
bits, and an instant in the past.
"""

_PARAMETERS = {
    "GEOMETRY": "65536 rows + columns",
    "CLOCK_HZ": "clock of the sequencer, Hz",
    "BUILD": "CRC-32 of the table",
    "BIT_CLOCKS": "CLOCK_HZ / baud, rounded",
    "IMAGER": "number of the imager, see below",
}


def document() -> str:
    """Text of docs/imager-registers.md."""
    lines = [_HEAD, "## Common head", "", *register_tables(HEAD, "###")]
    lines += ["| name | meaning |", "|---|---|"]
    lines += [f"| {name} | {meaning} |" for name, meaning in _PARAMETERS.items()]
    for name, kind in IMAGERS.items():
        if kind.number is None:
            continue
        design = kind.design()
        rows, columns = design.shape
        lines += [
            "",
            f"## {name}",
            "",
            f"Number {design.number}, {design.title}. By default it has {rows} rows x {columns} "
            f"columns and a clock of {design.clock_hz / 1e6:g} MHz.",
            "",
            design.document("###").rstrip(),
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(document())
