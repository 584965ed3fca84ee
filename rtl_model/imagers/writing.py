"""What an imager refuses of a write to one of its registers, whatever its rule of taking it."""

from __future__ import annotations

from cosim import InputError
from rtl_model.registers.table import Register

__all__ = ["write_instant"]


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
