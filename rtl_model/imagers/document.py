"""docs/imager-registers.md, written from the imagers' tables.

`python -m rtl_model.imagers.document > docs/imager-registers.md` makes it anew.
"""

from __future__ import annotations

import sys

from rtl_model.imagers.catalogue import IMAGERS
from rtl_model.imagers.device.registers import HEAD
from rtl_model.registers.document import register_tables

__all__ = ["document"]

_HEAD = """\
# Registers of the imagers

Made from the tables in `rtl_model/imagers` by `python -m rtl_model.imagers.document`; do not edit.

Every conventional imager has registers as the spike chip's board has, whose map is
[registers.md](registers.md): 32-bit words behind LiteX's uartbone, the same head at the same
addresses, the identifier at 0x800. `viform board virtual --imager NAME` puts one behind a serial
port, and `viform board identify` and `viform board regs` speak to it as to a board; `--csr FILE`
there writes the `csr.csv` for other tools. An imager's own registers begin at 0x300.

A register reads at once what was written to it. When the sequencer takes it to work is said with
each: at once, with the next frame, or with the next cycle; those that wait for one instant are
taken together. A word is strobed one clock after its last byte has come whole, and what begins at
that very clock does not see it yet.

The line cannot refuse a write, as the hardware behind it cannot: bits beyond a register's width are
dropped, a write to a register that is only read changes nothing, and one to no register changes
nothing but `ctrl_bus_errors`. (`viform board regs` looks at the table before it writes, and refuses
there.) A scenario's `imager.writes`, and `write` of an imager in Python, go by the same table in
every imager and are refused instead, in one line: a register that does not exist or is only read, a
value of more bits than it has, an instant that has passed.
"""

_PARAMETERS = {
    "GEOMETRY": "65536 rows + columns",
    "CLOCK_HZ": "clock of the sequencer, Hz",
    "BUILD": "CRC-32 of the table",
    "BIT_CLOCKS": "CLOCK_HZ / baud, rounded",
    "IMAGER": "the number below",
}


def document() -> str:
    """Returns docs/imager-registers.md as text."""
    lines = [_HEAD, "## Head, of every imager", "", *register_tables(HEAD, "###")]
    lines += ["| name | meaning |", "|---|---|"]
    lines += [f"| {name} | {meaning} |" for name, meaning in _PARAMETERS.items()]
    for name, kind in IMAGERS.items():
        if kind.number is None:
            continue
        made = kind.design()
        rows, columns = made.shape
        lines += [
            "",
            f"## {name}",
            "",
            f"Number {made.number}, {made.title}: {rows} rows x {columns} columns, "
            f"{made.clock_hz / 1e6:g} MHz as it is by default.",
            "",
            made.document("###").rstrip(),
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(document())
