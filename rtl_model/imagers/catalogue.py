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

IMAGERS = {"adaptive-exposure": 1, "ebaps": 2, "emccd": 3}
"""Kinds of imagers by name, and what `ctrl_imager` reads of each."""


def by_number(number: int) -> str | None:
    """Returns the kind whose `ctrl_imager` reads so, or None."""
    return next((name for name, each in IMAGERS.items() if each == number), None)


def design(name: str) -> Design:
    """Returns the registers of a kind of imager as it is by default; InputError for none such."""
    match name:
        case "adaptive-exposure":
            from rtl_model.imagers.adaptive.registers import DESIGN as ADAPTIVE

            return ADAPTIVE
        case "ebaps":
            from rtl_model.imagers.ebaps.registers import DESIGN as EBAPS

            return EBAPS
        case "emccd":
            from rtl_model.imagers.emccd.registers import DESIGN as EMCCD

            return EMCCD
    raise _none_such(name)


def machine(name: str) -> Machine:
    """Returns an imager's sequencer after power-on, with its registers and steady light of its own
    choice, but no pixels; InputError for none such."""
    match name:
        case "adaptive-exposure":
            from rtl_model.imagers.adaptive.machine import machine as adaptive

            return adaptive()
        case "ebaps":
            from rtl_model.imagers.ebaps.machine import machine as ebaps

            return ebaps()
        case "emccd":
            from rtl_model.imagers.emccd.machine import machine as emccd

            return emccd()
    raise _none_such(name)


def _none_such(name: str) -> InputError:
    return InputError("an imager", "one of " + ", ".join(IMAGERS), repr(name), "name one")
