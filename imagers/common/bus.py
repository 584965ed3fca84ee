"""The register bus of an imager, behind the same bridge as the bus of the spike camera's board.

`line_of(target)` returns the device side of `rtl_model.host`: LiteX's uartbone at byte level, in
clocks of the imager's sequencer. A bus access takes place at a clock edge. A write is visible at
later edges; a read returns the value at its edge.
"""

from __future__ import annotations

from typing import Protocol

from imagers.common.register_file import RegisterFile
from rtl_model.cycle import Bridge
from rtl_model.cycle.line import LineCounters
from rtl_model.geometry import Geometry
from rtl_model.registers.design import IDENTIFIER

__all__ = ["BusTarget", "ImagerBus", "line_of"]

_WORD = 0xFFFFFFFF


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
        """Returns the 32 bits at a byte address at this clock; takes two clocks."""
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
    """Returns the serial line of an imager at byte level; byte_clocks as in `cycle.Bridge`."""
    return Bridge(system=ImagerBus(target), byte_clocks=byte_clocks)
