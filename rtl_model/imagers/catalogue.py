"""The imagers there are, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from cosim import InputError
from rtl_model.imagers.adaptive.kind import AdaptiveKind
from rtl_model.imagers.ebaps.kind import EbapsKind
from rtl_model.imagers.emccd.kind import EmccdKind
from rtl_model.imagers.interface.kind import ImagerKind

if TYPE_CHECKING:  # a host that reads registers needs none of the sequencers
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.device.registers import Design

__all__ = ["IMAGERS", "bus_target", "by_number", "design"]

IMAGERS: Final[dict[str, ImagerKind]] = {
    AdaptiveKind.name: AdaptiveKind(),
    EbapsKind.name: EbapsKind(),
    EmccdKind.name: EmccdKind(),
}


def by_number(number: int) -> str | None:
    """Returns the kind whose `ctrl_imager` reads so, or None."""
    return next((name for name, kind in IMAGERS.items() if kind.number == number), None)


def design(name: str) -> Design:
    """Returns the registers of a kind of imager as it is by default; InputError for none such."""
    return _kind(name).design()


def bus_target(name: str) -> BusTarget:
    """Returns an imager's sequencer after power-on, with its registers and steady light of its own
    choice, but no pixels; InputError for none such."""
    return _kind(name).bus_target()


def _kind(name: str) -> ImagerKind:
    if name not in IMAGERS:
        raise InputError("an imager", "one of " + ", ".join(IMAGERS), repr(name), "name one")
    return IMAGERS[name]
