"""The registers of an imager: written and active values, and when a write takes effect.

A register reads the value last written, so a host can verify its write. The sequencer uses the
active value, which follows at the instant that the register's `Update` names. All registers that
wait for the same instant are updated together.
"""

from __future__ import annotations

from collections.abc import Callable

from rtl_model.registers import reset_value
from rtl_model.registers.design import Design, Update

__all__ = ["RegisterFile"]


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
