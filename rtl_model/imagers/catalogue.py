"""All kinds of imagers, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from cosim import InputError
from rtl_model.imagers.adaptive.kind import AdaptiveKind
from rtl_model.imagers.ebaps.kind import EbapsKind
from rtl_model.imagers.emccd.kind import EmccdKind
from rtl_model.imagers.hardware_chain.kind import HardwareChainKind
from rtl_model.imagers.interface.kind import ImagerKind
from rtl_model.imagers.pulse.kind import PfmKind, PwmKind

if TYPE_CHECKING:  # a host that reads registers must not load the sequencers
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.device.registers import Design

__all__ = ["IMAGERS", "bus_target", "by_number", "design"]

IMAGERS: Final[dict[str, ImagerKind]] = {
    AdaptiveKind.name: AdaptiveKind(),
    EbapsKind.name: EbapsKind(),
    EmccdKind.name: EmccdKind(),
    HardwareChainKind.name: HardwareChainKind(),
    PwmKind.name: PwmKind(),
    PfmKind.name: PfmKind(),
}


def by_number(number: int) -> str | None:
    """Returns the name of the kind with this value of `ctrl_imager`, or None."""
    return next((name for name, kind in IMAGERS.items() if kind.number == number), None)


def design(name: str) -> Design:
    """Returns the registers of a kind at default settings; raises InputError for an unknown
    name."""
    return _kind(name).design()


def bus_target(name: str) -> BusTarget:
    """Returns the sequencer of a kind after power-on, with its registers, under constant light and
    without pixels; raises InputError for an unknown name."""
    return _kind(name).bus_target()


def _kind(name: str) -> ImagerKind:
    if name not in IMAGERS:
        raise InputError("an imager", "one of " + ", ".join(IMAGERS), repr(name), "name one")
    return IMAGERS[name]
