"""Names of the effects between panel and camera, and a link without some of them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

from display import SpikePanel
from link.air.setting import Aim, AirSetting, Optics

NAMES: Final = (
    "lens blur", "diffraction", "defocus", "vibration", "misalignment", "fog extinction",
    "airlight", "fog blur", "ambient on the panel", "surroundings", "glare", "sun",
    "scintillation", "emitter response",
)  # fmt: skip
"""All effects, in the order of reports."""


@dataclass(frozen=True)
class Scene:
    """The optical path of a link.

    Attributes:
        panel: the panel's timing and emitter.
        optics: the panel's pixels and the lens.
        aim: position of the panel in the view.
        air: the atmosphere and the light around.
    """

    panel: SpikePanel
    optics: Optics
    aim: Aim
    air: AirSetting


def simplified(scene: Scene, effects: Collection[str]) -> Scene:
    """Scene without the effects that are not in `effects`.

    Fog, ambient light, surroundings and defocus have no number of their own in the scene; the code
    that computes them distinguishes them.
    """
    panel, optics, aim, air = scene.panel, scene.optics, scene.aim, scene.air
    if "emitter response" not in effects:
        panel = replace(panel, rise=0.0, decay=0.0)
    if "lens blur" not in effects:
        optics = replace(optics, blur=0.0)
    if "diffraction" not in effects:
        optics = replace(optics, diffraction=False)
    if "vibration" not in effects:
        aim = replace(aim, vibration=0.0)
    if "misalignment" not in effects:
        aim = replace(aim, rotation=0.0, tilt=(0.0, 0.0))
    if "glare" not in effects:
        air = replace(air, glare=0.0)
    if "sun" not in effects:
        air = replace(air, sun=0.0)
    if "scintillation" not in effects:
        air = replace(air, structure=0.0)
    return Scene(panel, optics, aim, air)
