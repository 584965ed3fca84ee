"""The register map of a device other than the board of the spike camera, such as a conventional
imager: one table for the bus, `csr.csv` and the document of its registers.

The common head (magic, scratch, version, geometry, clock, reset, line counters, identifier) has the
same addresses as on the board of the spike camera, so one host program reads both. The register
`ctrl_imager` identifies the device. The registers of one kind of device begin at
`SPECIFIC_ADDRESS`. A host and a virtual board know only the devices that their caller passes.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, Protocol

from rtl_model.geometry import Geometry
from rtl_model.registers.csr_csv import csr_text
from rtl_model.registers.document import register_tables
from rtl_model.registers.table import MEMORIES, REGISTERS, Memory, Register

if TYPE_CHECKING:
    from rtl_model.cycle import Behind

IMAGER_MAGIC = 0x56494D47
"""ASCII "VIMG": the first word of every conventional imager."""
IMAGER_VERSION = 0x0001_0000
"""Version of the register maps of the imagers: major in the upper half, minor in the lower."""
SPECIFIC_ADDRESS = 0x300
"""Lowest byte address of the registers of one kind of imager."""
CONSTANT = "config_viform_imager"
"""Constant in csr.csv that names the imager."""
Update = Literal["now", "frame", "cycle"]
"""Instant at which a written value takes effect: at once, at the next frame or cycle."""
IDENTIFIER: Memory = next(memory for memory in MEMORIES if memory.name == "identifier_mem")
NO_DEVICES: Devices = MappingProxyType({})
"""What a host knows whose caller passes no device: the board of the spike camera alone."""


def head() -> tuple[Register, ...]:
    """The registers that every imager has, derived from the table of the board."""
    changed = {
        "ctrl_magic": {"reset": IMAGER_MAGIC, "text": 'ASCII "VIMG"'},
        "ctrl_version": {"reset": IMAGER_VERSION},
        "ctrl_build": {"text": "CRC-32 of the register table"},
        "ctrl_clock_hz": {"text": "clock that all clocks here are counted in, Hz"},
    }
    common = [
        entry._replace(**changed.get(entry.name, {}))  # type: ignore[arg-type]
        for entry in REGISTERS
        if entry.name.split("_")[0] in ("ctrl", "uart") and entry.name != "ctrl_lanes"
    ]
    number = Register("ctrl_imager", 0x028, "ro", "IMAGER", 8, "which imager it is")
    last = max(n for n, entry in enumerate(common) if entry.name.startswith("ctrl_"))
    return (*common[: last + 1], number, *common[last + 1 :])


HEAD = head()


@dataclass(frozen=True)
class Design:
    """The registers of one kind of device behind a serial line.

    Attributes:
        name: `imager.kind` in a scenario.
        number: value of the register `ctrl_imager`.
        title: a few words for headings.
        shape: (rows, columns) of the pixels that are read.
        clock_hz: clock of the sequencer, Hz; all registers count in its cycles.
        specific: registers of this kind, at `SPECIFIC_ADDRESS` and above.
        updates: register name -> when a written value takes effect; at once if not listed.
        baud: baud rate of the line.
    """

    name: str
    number: int
    title: str
    shape: tuple[int, int]
    clock_hz: int
    specific: Sequence[Register]
    updates: Mapping[str, Update] = field(default_factory=dict)
    baud: int = 115_200

    def __post_init__(self) -> None:
        names = {entry.name: entry for entry in self.specific}
        for name in self.updates:
            if name not in names or names[name].mode == "ro":
                raise ValueError(f"{name} is no register of {self.name} that can be written")
        low = [entry.name for entry in self.specific if entry.address < SPECIFIC_ADDRESS]
        if low:
            raise ValueError(f"{', '.join(low)} must stand at {SPECIFIC_ADDRESS:#x} or above")

    @property
    def registers(self) -> tuple[Register, ...]:
        """The whole table: the common head and the specific registers."""
        return (*HEAD, *self.specific)

    @property
    def memories(self) -> tuple[Memory, ...]:
        """Memory regions: the identifier only."""
        return (IDENTIFIER,)

    @property
    def identifier(self) -> str:
        """Text of the identifier memory."""
        return f"Viform {self.name} {self.shape[0]}x{self.shape[1]}"

    @property
    def geometry(self) -> Geometry:
        """Size, clock and baud rate for the bridge of the serial line."""
        rows, columns = self.shape
        return Geometry(rows, columns, clock_hz=self.clock_hz, baud=self.baud)

    @cached_property
    def values(self) -> dict[str, int]:
        """Values of the parameters that the table names."""
        table = repr((self.name, self.shape, self.clock_hz, self.baud, self.registers))
        return {
            "GEOMETRY": self.shape[0] << 16 | self.shape[1],
            "CLOCK_HZ": self.clock_hz,
            "BUILD": zlib.crc32(table.encode()),
            "BIT_CLOCKS": self.geometry.bit_clocks,
            "IMAGER": self.number,
            "IDENTIFIER_BYTES": 4 * (len(self.identifier) + 1),
        }

    def csr_csv(self) -> str:
        """The imager's `csr.csv`."""
        return csr_text(
            self.registers, self.memories, self.values, self.clock_hz, {CONSTANT: self.name}
        )

    def document(self, heading: str = "##") -> str:
        """The specific registers as Markdown."""
        instants = {
            "now": "at once",
            "frame": "with the next frame",
            "cycle": "with the next cycle",
        }
        registers = []
        for entry in self.specific:
            when = instants[self.updates.get(entry.name, "now")]
            text = entry.text if entry.mode != "rw" else f"{entry.text}; takes effect {when}"
            registers.append(entry._replace(text=text))
        return "\n".join(register_tables(registers, heading))


class Device(Protocol):
    """A device that a host recognises by its first registers and a virtual board can serve."""

    @property
    def name(self) -> str:
        """Name on the command line and in `csr.csv`."""
        ...

    @property
    def number(self) -> int | None:
        """Value of its register `ctrl_imager`; None for a device without registers."""
        ...

    def design(self) -> Design:
        """Its registers at default settings. Raises InputError for a device without registers."""
        ...

    def bus(self, geometry: Geometry) -> Behind:
        """Its bus after power-on, behind a line of this clock and baud. Raises InputError for a
        device without registers."""
        ...


Devices = Mapping[str, Device]
"""Devices by name."""
