"""The register writes of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

from cosim import InputError, seconds_to_ps
from cosim.errors import quote
from imagers.common.imager import Imager

__all__ = ["write_all"]


def write_all(imager: Imager, writes: Sequence[tuple[float, str, int]]) -> None:
    """Schedules all writes before the imager films.

    Args:
        imager: at power-on.
        writes: (instant in s, register name, value) of each write.

    Raises InputError that names `imager.writes` for a write that the imager refuses: an unknown or
    read-only register, or a value that does not fit. (A serial line would drop or truncate such a
    write silently, because the hardware cannot refuse it.)
    """
    for n, (seconds, register, value) in enumerate(writes):
        try:
            imager.write(register, value, seconds_to_ps(seconds))
        except InputError as exc:
            which = "its register" if exc.what == "register" else f"{exc.what} to be"
            given = quote([f"{seconds:g} s", register, value])  # holds the register
            given += "" if exc.what == "register" else f" ({exc.actual})"
            raise InputError(
                f"imager.writes.{n}", f"a write that the imager takes, {which} {exc.must}",
                given, exc.remedy,
            ) from exc  # fmt: skip
