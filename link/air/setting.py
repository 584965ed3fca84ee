"""Parameters of the path from the panel's pixels to the camera's, and the path without some
effects.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

from display import SpikePanel
from link.theory.air import Particles

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


@dataclass(frozen=True)
class Optics:
    """The panel's pixels and the lens.

    Attributes:
        width, height: panel pixels.
        pitch: pitch of the panel's pixels, m.
        luminance: luminance of an ON pixel, cd/m2.
        reflectance: diffuse reflectance of the panel's face.
        focal_length: m.
        f_number, transmission: f-number and transmission of the lens.
        focus: distance that the lens is focused at, m; None for the panel's distance.
        blur: standard deviation of the lens's blur without diffraction and defocus, camera pixels.
        camera_pitch: pitch of the camera's pixels, m.
        wavelength_nm: wavelength of the light, nm.
        diffraction: whether diffraction is included.
    """

    width: int
    height: int
    pitch: float
    luminance: float
    reflectance: float
    focal_length: float
    f_number: float
    transmission: float
    focus: float | None
    blur: float
    camera_pitch: float
    wavelength_nm: float = 555.0
    diffraction: bool = True


@dataclass(frozen=True)
class Aim:
    """Position of the panel in the camera's view.

    Attributes:
        offset: (x, y) of the panel's centre from the sensor's centre in the image, camera pixels.
        rotation: rotation about the line of sight, degrees, clockwise in the image.
        tilt: rotation about the vertical and about the horizontal axis, degrees.
        vibration: standard deviation of the image's shift along each axis, camera pixels.
        vibration_frequency: resonance, Hz, at a tenth of critical damping.
        occluded: share of the panel, from its left side, that is hidden.
        blocked: spans of time (start, stop), ps, in which the whole panel is hidden. A symbol is
            hidden if it begins in one.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    vibration: float = 0.0
    vibration_frequency: float = 30.0
    occluded: float = 0.0
    blocked: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class AirSetting:
    """The atmosphere and the light around the panel.

    Attributes:
        distance: distance from lens to panel, m.
        ambient: illuminance of the panel's face and its surroundings, lux.
        surroundings: reflectance of the surroundings.
        visibility: m, None for clear air.
        particles: law of extinction.
        structure: refractive-index structure constant Cn2, m^(-2/3), constant along the path.
        wind: speed of the wind across the path, m/s.
        sun: illuminance of a plane that faces the sun, lux; 0 for no sun in or near the view.
        sun_angle: angle of the sun from the panel's centre, to the right, degrees.
        glare: share of the light through the lens that is spread over the whole image.
        seed: seed of vibration and scintillation.
    """

    distance: float
    ambient: float = 0.0
    surroundings: float = 0.18
    visibility: float | None = None
    particles: Particles = "kim"
    structure: float = 0.0
    wind: float = 1.0
    sun: float = 0.0
    sun_angle: float = 10.0
    glare: float = 0.005
    seed: int = 1
