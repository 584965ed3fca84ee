"""The registers of an imager: values, the bus in front of them, and checks of writes.

`RegisterFile` holds written and active values, and states when a write takes effect. A register
reads the value last written, so a host can verify its write. The sequencer uses the active value,
which follows at the instant that the register's `Update` names. All registers that wait for the
same instant are updated together.

`ImagerBus` is the bus, behind the same bridge as the bus of the spike camera's board.
`line_of(target)` returns the device side of `rtl_model.host`: LiteX's uartbone at byte level, in
clocks of the imager's sequencer. A bus access takes place at a clock edge. A write is visible at
later edges; a read returns the value at its edge.

`register_of` and `write_instant` check writes from Python or from a scenario, the same for every
imager. The bus cannot refuse a write (`RegisterFile.write`): as in hardware, it drops bits beyond
the width of a register and ignores a write to a read-only register.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from cosim import InputError
from cosim.errors import quote, shorten
from rtl_model.cycle import Bridge
from rtl_model.cycle.system import LineCounters
from rtl_model.geometry import Geometry
from rtl_model.registers import reset_value
from rtl_model.registers.design import IDENTIFIER, Design, Update
from rtl_model.registers.table import Register

_WORD = 0xFFFFFFFF
_NAMES: Final = 80
"""Characters of a list of registers in a message."""


class RegisterFile:
    """Values of a design's registers by name.

    Attributes:
        design: the register table.
        table: register by name.
        on_write: name -> function that is called with the value after the register was written.
        on_read: name -> function that returns the value of a read-only register; a side effect of
            reading takes place in it.
    """

    def __init__(self, design: Design) -> None:
        self.design = design
        self.table = {entry.name: entry for entry in design.registers}
        self.on_write: dict[str, Callable[[int], None]] = {}
        self.on_read: dict[str, Callable[[], int]] = {}
        self.reset()

    def reset(self) -> None:
        """Sets all written and active values to their reset values."""
        values = self.design.values
        self._written = {name: reset_value(entry, values) for name, entry in self.table.items()}
        self._active = dict(self._written)

    def write(self, name: str, value: int) -> None:
        """Writes as the bus does: bits beyond the width are dropped, and a read-only register does
        not change. Raises KeyError for an unknown register."""
        entry = self.table[name]
        if entry.mode == "ro":
            return
        value &= (1 << entry.width) - 1
        if entry.mode == "rw":
            self._written[name] = value
        if self.update_of(name) == "now":
            self._active[name] = value
        if name in self.on_write:
            self.on_write[name](value)

    def read(self, name: str) -> int:
        """Reads as the bus does: a write-only register reads 0. Raises KeyError for an unknown
        register."""
        entry = self.table[name]
        if entry.mode == "wo":
            return 0
        reader = self.on_read.get(name)
        value = self._written[name] if reader is None else reader()
        return value & ((1 << entry.width) - 1)

    def update_of(self, name: str) -> Update:
        """When a written value takes effect."""
        return self.design.updates.get(name, "now")

    def update(self, when: Update) -> bool:
        """Activates all values that wait for this instant. Returns whether any value changed."""
        changed = False
        for name, value in self._written.items():
            if self.update_of(name) == when and self._active[name] != value:
                self._active[name] = value
                changed = True
        return changed

    def active(self, name: str) -> int:
        """The value that the sequencer uses."""
        return self._active[name]

    def set(self, name: str, value: int) -> None:
        """Sets the written and the active value; for the imager itself, not for the bus."""
        value &= (1 << self.table[name].width) - 1
        self._written[name] = self._active[name] = value


class BusTarget(Protocol):
    """A sequencer with registers. Clocks count from power-on.

    Attributes:
        registers: all registers; the bus connects those of the common head.
    """

    @property
    def registers(self) -> RegisterFile: ...

    def advance(self, clock: int) -> None:
        """Runs all edges before `clock`; does nothing if that clock has passed."""

    def reset(self, clock: int) -> None:
        """Restarts at edge `clock`; the registers have been reset before."""


class ImagerBus:
    """The registers of an imager as `rtl_model.cycle.Bridge` reads and writes them.

    Args:
        target: sequencer with registers.
        geometry: clock and baud rate of the line; None for those of the design.
    """

    def __init__(self, target: BusTarget, geometry: Geometry | None = None) -> None:
        self.target = target
        self.line = LineCounters()
        design = target.registers.design
        self._geometry = geometry or design.geometry
        self._clock = 0
        self._errors = 0
        self._identifier = design.identifier.encode("ascii") + b"\0"
        self._names = {entry.address: entry.name for entry in design.registers}
        self._reset = next(e.address for e in design.registers if e.name == "ctrl_reset")
        self._attach(target.registers)

    @property
    def geometry(self) -> Geometry:
        """Geometry from which the bridge takes clock and baud rate."""
        return self._geometry

    @property
    def clock(self) -> int:
        """Clock edges since power-on."""
        return self._clock

    def advance(self, stop: int) -> None:
        """Runs up to clock `stop`; does nothing if that clock has passed."""
        if stop > self._clock:
            self.target.advance(stop)
            self._clock = stop

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address at this clock; takes one clock."""
        address, value = address & ~3, value & _WORD
        name = self._names.get(address)
        self.advance(self._clock + 1)
        if address == self._reset and value & 1:
            self._errors = 0
            self.target.registers.reset()
            self.target.reset(self._clock)
        elif name is not None:
            self.target.registers.write(name, value)
        elif self._character(address) is None:
            self._errors += 1

    def read(self, address: int) -> int:
        """The 32 bits at a byte address at this clock; takes two clocks."""
        value = self._value(address & ~3)
        self.advance(self._clock + 2)
        return value

    def _value(self, address: int) -> int:
        name = self._names.get(address)
        if name is not None:
            return self.target.registers.read(name)
        character = self._character(address)
        if character is None:
            self._errors += 1
            return 0
        return character

    def _character(self, address: int) -> int | None:
        place = (address - IDENTIFIER.address) // 4
        return self._identifier[place] if 0 <= place < len(self._identifier) else None

    def _attach(self, registers: RegisterFile) -> None:
        """Connects the registers of the common head."""
        registers.on_read |= {
            "ctrl_bus_errors": lambda: self._errors,
            "ctrl_uptime": lambda: self._clock,
            "uart_bit_clocks": lambda: self._geometry.bit_clocks,
        }
        for name, entry in registers.table.items():
            group, rest = name.split("_", 1)
            if group == "uart" and entry.mode == "ro" and hasattr(self.line, rest):
                registers.on_read[name] = lambda rest=rest: self.line.read(rest)  # type: ignore[misc]
        registers.on_write["uart_clear"] = lambda value: self.line.clear() if value else None


def line_of(target: BusTarget, byte_clocks: int | None = None) -> Bridge:
    """The serial line of an imager at byte level; byte_clocks as in `cycle.Bridge`."""
    return Bridge(system=ImagerBus(target), byte_clocks=byte_clocks)


def register_of(registers: RegisterFile, register: str) -> Register:
    """The entry of a register by its name. The group of the imager may be omitted ("exposure" for
    "emccd_exposure"). Raises InputError for an unknown register."""
    group = registers.design.specific[0].name.split("_", 1)[0]
    for name in (register, f"{group}_{register}"):
        if name in registers.table:
            return registers.table[name]
    written = [e.name.split("_", 1)[1] for e in registers.design.specific if e.mode != "ro"]
    raise InputError(
        "register", shorten(f"one of {', '.join(written)}", _NAMES), quote(register),
        "choose one (docs/imager-registers.md has all)",
    )  # fmt: skip


def write_instant(entry: Register, register: str, value: int, at: int | None, now: int) -> int:
    """The instant of a write, ps: `at`, or `now` if `at` is None.

    Args:
        entry: the register.
        register: its name as the caller wrote it, for messages.
        value: value to be written.
        at: instant of the write, ps.
        now: present instant, ps.

    Raises InputError for a read-only register, a value that does not fit, an instant in the past.
    """
    if entry.mode == "ro":
        raise InputError(
            register, "a register that is written", "one that is only read", "write another"
        )
    if not 0 <= value < 1 << entry.width:
        raise InputError(
            register, f"0 to {(1 << entry.width) - 1}", str(value), f"it has {entry.width} bits"
        )
    when = now if at is None else at
    if when < now:
        raise InputError(
            register, f"written at {now} ps or later", f"at {when} ps", "time does not go back"
        )
    return when
