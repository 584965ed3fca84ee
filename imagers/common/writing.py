"""Checks of register writes from Python or from a scenario, the same for every imager.

The bus cannot refuse a write (`RegisterFile.write`): as in hardware, it drops bits beyond the width
of a register and ignores a write to a read-only register.
"""

from __future__ import annotations

from typing import Final

from cosim import InputError
from cosim.errors import quote, shorten
from imagers.common.register_file import RegisterFile
from rtl_model.registers.table import Register

__all__ = ["register_of", "write_instant"]

_NAMES: Final = 80
"""Characters of a list of registers in a message."""


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
    """Returns the instant of a write, ps: `at`, or `now` if `at` is None.

    Args:
        entry: the register.
        register: its name as the caller wrote it, for messages.
        value: to be written.
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
