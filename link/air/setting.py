"""Everything between the panel's pixels and the camera's, as numbers."""

from __future__ import annotations

from dataclasses import dataclass

from link.theory.extinction import Particles

__all__ = ["Aim", "AirSetting", "Optics"]


@dataclass(frozen=True)
class Optics:
    """The panel and the lens. width, height: panel pixels. pitch: of them, m. luminance: of a pixel
    that is on, cd/m2. reflectance: of the panel's face (diffuse). focal_length: m. f_number,
    transmission: of the lens. focus: distance it is focused at, m; None: at the panel. blur: of the
    lens beside diffraction and defocus, standard deviation, camera pixels. camera_pitch: m.
    wavelength_nm: of the light."""

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
    """How the panel stands in the camera's view. offset: (x, y) of its centre's image from the
    sensor's, camera pixels. rotation: about the line of sight, degrees, clockwise in the image.
    tilt: (about the vertical, about the horizontal), degrees. vibration: standard deviation of the
    image's shift along each axis, camera pixels. vibration_frequency: Hz, of a resonance with a
    tenth of critical damping. occluded: share of the panel, from its left, that is hidden."""

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    vibration: float = 0.0
    vibration_frequency: float = 30.0
    occluded: float = 0.0


@dataclass(frozen=True)
class AirSetting:
    """distance: from lens to panel, m. ambient: lux, on the panel's face and its surroundings.
    surroundings: their reflectance. visibility: m, None for clear air. particles: which law of
    extinction. structure: Cn2, m^(-2/3), constant along the path. wind: across the path, m/s. sun:
    lux on a plane facing it, of a sun within the view or near it; 0 for none. sun_angle: degrees
    between it and the panel's centre, to the right. glare: share of the light through the lens that
    is spread over the whole image. seed: of vibration and scintillation."""

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
