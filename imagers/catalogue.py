"""All kinds of imagers, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from cosim import InputError
from imagers.adaptive.kind import AdaptiveKind
from imagers.common.kind import ImagerKind
from imagers.ebaps.kind import EbapsKind
from imagers.emccd.kind import EmccdKind
from imagers.hardware_chain.kind import HardwareChainKind
from imagers.pulse.kind import PfmKind, PwmKind

if TYPE_CHECKING:
    from sensor.laboratory.cameras import Camera

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


def measured_cameras() -> dict[str, Camera]:
    """The imagers that `viform laboratory` measures, by name."""
    cameras = (kind.measured() for kind in IMAGERS.values())
    return {camera.name: camera for camera in cameras if camera is not None}
