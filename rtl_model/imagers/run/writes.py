"""A scenario's register writes, given to its imager before it films."""

from __future__ import annotations

from collections.abc import Sequence

from cosim import InputError, seconds_to_ps
from rtl_model.imagers.imager import Imager

__all__ = ["write_all"]


def write_all(imager: Imager, writes: Sequence[tuple[float, str, int]]) -> None:
    """writes: instant (s), register, value. InputError that names `imager.writes` for one that the
    imager refuses: no such register, one that is only read, a value that does not fit. (Over a
    serial line such a write would be lost or cut without a word, as the hardware cannot refuse.)"""
    for n, (seconds, register, value) in enumerate(writes):
        try:
            imager.write(register, value, seconds_to_ps(seconds))
        except InputError as exc:
            which = "its register" if exc.what == "register" else f"{exc.what} to be"
            raise InputError(
                f"imager.writes.{n}", f"a write that the imager takes, {which} {exc.must}",
                f"{[f'{seconds:g} s', register, value]} ({exc.actual})", exc.remedy,
            ) from exc  # fmt: skip
