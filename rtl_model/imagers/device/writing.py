"""One rule for writes to an imager's registers from Python or a scenario: what is refused, in which
words, whatever the imager's rule of taking what was written.

The bus cannot refuse (`RegisterFile.write`): there bits beyond a register's width are dropped and a
register that is only read is left alone, as in hardware.
"""

from __future__ import annotations

from cosim import InputError
from rtl_model.imagers.device.register_file import RegisterFile
from rtl_model.registers.table import Register

__all__ = ["register_of", "write_instant"]


def register_of(registers: RegisterFile, register: str) -> Register:
    """The entry of a register by its name, which may leave out the imager's own group ("exposure"
    for "emccd_exposure"). InputError for none such."""
    own = [entry.name for entry in registers.design.own]
    group = own[0].split("_", 1)[0]
    for name in (register, f"{group}_{register}"):
        if name in registers.table:
            return registers.table[name]
    raise InputError("register", f"one of {', '.join(own)}", register, "look at the table")


def write_instant(entry: Register, register: str, value: int, at: int | None, now: int) -> int:
    """When the write is made, ps: `at`, or `now` for None. register: as whoever writes named it.

    InputError for a register that is only read, a value that does not fit, a time that has passed.
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
