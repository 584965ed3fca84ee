"""Names of the effects between panel and camera, and a link with some of them left out."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

from display import SpikePanel
from link.air.setting import Aim, AirSetting, Optics

__all__ = ["NAMES", "Scene", "simplified"]

NAMES: Final = (
    "lens blur", "diffraction", "defocus", "vibration", "misalignment", "fog extinction",
    "airlight", "fog blur", "ambient on the panel", "surroundings", "glare", "sun",
    "scintillation", "emitter response",
)  # fmt: skip
"""Every effect, in the order of reports."""


@dataclass(frozen=True)
class Scene:
    """What stands between bytes and light: panel, lens, aim and air."""

    panel: SpikePanel
    optics: Optics
    aim: Aim
    air: AirSetting


def simplified(scene: Scene, kept: Collection[str]) -> Scene:
    """The scene without the effects that are not in `kept`, as far as its numbers say them; fog,
    ambient light, surroundings and defocus are told apart where they are computed."""
    panel, optics, aim, air = scene.panel, scene.optics, scene.aim, scene.air
    if "emitter response" not in kept:
        panel = replace(panel, rise=0.0, decay=0.0)
    if "lens blur" not in kept:
        optics = replace(optics, blur=0.0)
    if "diffraction" not in kept:
        optics = replace(optics, diffraction=False)
    if "vibration" not in kept:
        aim = replace(aim, vibration=0.0)
    if "misalignment" not in kept:
        aim = replace(aim, rotation=0.0, tilt=(0.0, 0.0))
    if "glare" not in kept:
        air = replace(air, glare=0.0)
    if "sun" not in kept:
        air = replace(air, sun=0.0)
    if "scintillation" not in kept:
        air = replace(air, structure=0.0)
    return Scene(panel, optics, aim, air)
