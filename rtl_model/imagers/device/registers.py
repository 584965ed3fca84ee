"""An imager as its serial line shows it: one table of registers, of which the bus, `csr.csv` and
docs/imager-registers.md are made.

The head (magic, scratch, version, geometry, clock, reset, counters of the line, identifier) stands
at the addresses that it has on the spike chip's board, so that one host reads both; `ctrl_imager`
says which imager it is. An imager's own registers begin at `OWN`.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS, Memory, Register, csr_text
from rtl_model.registers.document import register_tables

__all__ = [
    "CONSTANT", "HEAD", "IDENTIFIER", "IMAGER_MAGIC", "IMAGER_VERSION", "OWN", "Design", "Taking",
    "head",
]  # fmt: skip

IMAGER_MAGIC = 0x56494D47
"""ASCII "VIMG": the first word of every conventional imager of ours."""
IMAGER_VERSION = 0x0001_0000
"""Of the imagers' register maps: major in the upper half, minor in the lower."""
OWN = 0x300
"""Byte address from which an imager's own registers stand."""
CONSTANT = "config_viform_imager"
"""Constant of the csr.csv that names the imager."""

Taking = Literal["now", "frame", "cycle"]
"""When a written register is taken to work: at once, at the next frame, at the next cycle."""

IDENTIFIER: Memory = next(memory for memory in MEMORIES if memory.name == "identifier_mem")


def head() -> tuple[Register, ...]:
    """Returns the registers that every imager has, made from the board's own table."""
    changed = {
        "ctrl_magic": {"reset": IMAGER_MAGIC, "text": 'ASCII "VIMG"'},
        "ctrl_version": {"reset": IMAGER_VERSION},
        "ctrl_build": {"text": "CRC-32 of the register table"},
        "ctrl_clock_hz": {"text": "clock that all clocks here are counted in, Hz"},
    }
    kept = [
        entry._replace(**changed.get(entry.name, {}))  # type: ignore[arg-type]
        for entry in REGISTERS
        if entry.name.split("_")[0] in ("ctrl", "uart") and entry.name != "ctrl_lanes"
    ]
    number = Register("ctrl_imager", 0x028, "ro", "IMAGER", 8, "which imager it is")
    last = max(n for n, entry in enumerate(kept) if entry.name.startswith("ctrl_"))
    return (*kept[: last + 1], number, *kept[last + 1 :])


HEAD = head()


@dataclass(frozen=True)
class Design:
    """One kind of imager behind a serial line.

    name: of the kind, as scenarios have it. number: what `ctrl_imager` reads. title: a few words.
    shape: (rows, columns) of the pixels that are read. clock_hz: of the sequencer, in which all
    registers count. own: its registers, from `OWN` on. taking: when a written one is taken to work,
    by name; at once where not named. baud: of the line.
    """

    name: str
    number: int
    title: str
    shape: tuple[int, int]
    clock_hz: int
    own: Sequence[Register]
    taking: Mapping[str, Taking] = field(default_factory=dict)
    baud: int = 115_200

    def __post_init__(self) -> None:
        names = {entry.name: entry for entry in self.own}
        for name in self.taking:
            if name not in names or names[name].mode == "ro":
                raise ValueError(f"{name} is no register of {self.name} that can be written")
        low = [entry.name for entry in self.own if entry.address < OWN]
        if low:
            raise ValueError(f"{', '.join(low)} must stand at {OWN:#x} or above")

    @property
    def registers(self) -> tuple[Register, ...]:
        """The whole table: head and own."""
        return (*HEAD, *self.own)

    @property
    def memories(self) -> tuple[Memory, ...]:
        """Regions of words: the identifier alone."""
        return (IDENTIFIER,)

    @property
    def identifier(self) -> str:
        """What the imager says it is."""
        return f"Viform {self.name} {self.shape[0]}x{self.shape[1]}"

    @property
    def geometry(self) -> Geometry:
        """Size, clock and baud, as the bridge of the serial line takes them."""
        rows, columns = self.shape
        return Geometry(rows, columns, clock_hz=self.clock_hz, baud=self.baud)

    @cached_property
    def values(self) -> dict[str, int]:
        """The parameters that the table names."""
        told = repr((self.name, self.shape, self.clock_hz, self.baud, self.registers))
        return {
            "GEOMETRY": self.shape[0] << 16 | self.shape[1],
            "CLOCK_HZ": self.clock_hz,
            "BUILD": zlib.crc32(told.encode()),
            "BIT_CLOCKS": self.geometry.bit_clocks,
            "IMAGER": self.number,
            "IDENTIFIER_BYTES": 4 * (len(self.identifier) + 1),
        }

    def csr_csv(self) -> str:
        """Returns the imager's `csr.csv`."""
        return csr_text(
            self.registers, self.memories, self.values, self.clock_hz, {CONSTANT: self.name}
        )

    def document(self, heading: str = "##") -> str:
        """Returns the imager's own registers as Markdown."""
        told = {"now": "at once", "frame": "with the next frame", "cycle": "with the next cycle"}
        registers = []
        for entry in self.own:
            when = told[self.taking.get(entry.name, "now")]
            text = entry.text if entry.mode != "rw" else f"{entry.text}; taken {when}"
            registers.append(entry._replace(text=text))
        return "\n".join(register_tables(registers, heading))
