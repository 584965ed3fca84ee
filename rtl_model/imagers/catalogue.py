"""All kinds of imagers, by name."""

from __future__ import annotations

from typing import Final

from cosim import InputError
from rtl_model.imagers.adaptive.kind import AdaptiveKind
from rtl_model.imagers.ebaps.kind import EbapsKind
from rtl_model.imagers.emccd.kind import EmccdKind
from rtl_model.imagers.hardware_chain.kind import HardwareChainKind
from rtl_model.imagers.interface.kind import ImagerKind
from rtl_model.imagers.pulse.kind import PfmKind, PwmKind

IMAGERS: Final[dict[str, ImagerKind]] = {
    AdaptiveKind.name: AdaptiveKind(),
    EbapsKind.name: EbapsKind(),
    EmccdKind.name: EmccdKind(),
    HardwareChainKind.name: HardwareChainKind(),
    PwmKind.name: PwmKind(),
    PfmKind.name: PfmKind(),
}


def kind_of(name: str) -> ImagerKind:
    """The kind of this name. Raises InputError for an unknown name."""
    if name not in IMAGERS:
        raise InputError("an imager", "one of " + ", ".join(IMAGERS), repr(name), "name one")
    return IMAGERS[name]
