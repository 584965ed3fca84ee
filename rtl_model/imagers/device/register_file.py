"""Registers of an imager as they work: what was written, what is at work, and when the one becomes
the other.

A register reads what was last written to it, so that a host can hold a write against it; what the
sequencer works with is `at_work`, and follows at the instant that the register's `Taking` names.
All that wait for one instant are taken together.
"""

from __future__ import annotations

from collections.abc import Callable

from rtl_model.imagers.device.registers import Design, Taking
from rtl_model.registers import reset_value

__all__ = ["RegisterFile"]


class RegisterFile:
    """Values of a design's registers by name.

    on_write: called with the value when a register is written (after it is held), for those whose
    writing does something. on_read: gives the value of a register that is only read, at that
    moment; where reading has an effect, it has it here.
    """

    def __init__(self, design: Design) -> None:
        self.design = design
        self.table = {entry.name: entry for entry in design.registers}
        self.on_write: dict[str, Callable[[int], None]] = {}
        self.on_read: dict[str, Callable[[], int]] = {}
        self.reset()

    def reset(self) -> None:
        """All values as after reset, none waiting."""
        values = self.design.values
        self._held = {name: reset_value(entry, values) for name, entry in self.table.items()}
        self._work = dict(self._held)

    def write(self, name: str, value: int) -> None:
        """Writes as the bus does: bits beyond the width are dropped, a register that is only read
        is left alone. KeyError for no such register."""
        entry = self.table[name]
        if entry.mode == "ro":
            return
        value &= (1 << entry.width) - 1
        if entry.mode == "rw":
            self._held[name] = value
        if self.taking(name) == "now":
            self._work[name] = value
        if name in self.on_write:
            self.on_write[name](value)

    def read(self, name: str) -> int:
        """Reads as the bus does; 0 of a register that is only written. KeyError for none such."""
        entry = self.table[name]
        if entry.mode == "wo":
            return 0
        reader = self.on_read.get(name)
        value = self._held[name] if reader is None else reader()
        return value & ((1 << entry.width) - 1)

    def taking(self, name: str) -> Taking:
        """When a written value is taken to work."""
        return self.design.taking.get(name, "now")

    def take(self, when: Taking) -> bool:
        """Takes to work, together, all that waits for this instant; whether anything changed."""
        changed = False
        for name, value in self._held.items():
            if self.taking(name) == when and self._work[name] != value:
                self._work[name] = value
                changed = True
        return changed

    def at_work(self, name: str) -> int:
        """The value that the sequencer works with."""
        return self._work[name]

    def put(self, name: str, value: int) -> None:
        """The machine itself sets what a register reads and works with."""
        value &= (1 << self.table[name].width) - 1
        self._held[name] = self._work[name] = value
