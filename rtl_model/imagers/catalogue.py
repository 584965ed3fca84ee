"""The imagers there are: names, numbers on the line, and how each is made to stand behind one.

An imager is loaded when it is asked for: its physics takes a moment to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cosim import InputError

if TYPE_CHECKING:
    from rtl_model.imagers.bus import Machine
    from rtl_model.imagers.registers import Design

__all__ = ["IMAGERS", "by_number", "design", "machine"]

IMAGERS = {"emccd": 3}
"""Kinds of imagers by name, and what `ctrl_imager` reads of each."""


def by_number(number: int) -> str | None:
    """Returns the kind whose `ctrl_imager` reads so, or None."""
    return next((name for name, each in IMAGERS.items() if each == number), None)


def design(name: str) -> Design:
    """Returns the registers of a kind of imager as it is by default; InputError for none such."""
    _known(name)
    from rtl_model.imagers import emccd

    return emccd.DESIGN


def machine(name: str) -> Machine:
    """Returns an imager after power-on, by default without light."""
    _known(name)
    from rtl_model.imagers import emccd

    return emccd.machine()


def _known(name: str) -> None:
    if name not in IMAGERS:
        raise InputError("an imager", "one of " + ", ".join(IMAGERS), repr(name), "name one")
