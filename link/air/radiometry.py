"""Illuminance on the sensor: of the panel's pixels, of their surroundings, of fog and of the sun.

A resolved surface of luminance L gives pi L T / (4 N^2 (v / f)^2) lux at any distance (Ray, Applied
Photographic Optics, 3rd ed., 2002), with v / f = 1 + m in focus. The cos^4 law is not modelled.

Fog attenuates, adds airlight and scatters forward. The extinction coefficient a follows from
visibility by Kim's or Kruse's law (`link.theory.air`). Light that reaches the lens through optical
thickness t = a d is L e^-t + h H + A (1 - e^-t - h) (Koschmieder's airlight). A is the fog's
luminance, E / pi under an illuminance E from all sides, for drops that absorb nothing. h is the
share of singly forward-scattered light and H its blurred image. Drops much larger than the
wavelength diffract half of the light that they remove (van de Hulst, Light Scattering by Small
Particles, 1957, 8.2 and 8.3), so h = t e^-t / 2. H is L blurred by the diffraction of drops of
10 um (assumed; radiation fog has 4 to 40 um), with a Gaussian that fits the Airy core.

The sun in or near the field of view gives its disc on the sensor and a glare in the lens.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosim import Clock, InputError
from cosim.config.amounts import at_most
from cosim.light.lens import FASTEST_F_NUMBER
from cosim.light.light import Plane
from link.air.geometry import Lengths, lengths
from link.air.setting import Aim, AirSetting, Optics
from link.theory.air import DB_PER_NEPER, Particles, extinction_db_per_km

DROP: Final = 10e-6
"""Diameter of a drop, m (assumed)."""
_CORE: Final = 0.42
"""Standard deviation of the Gaussian that fits an Airy core, in wavelength over aperture (Zhang,
Zerubia and Olivo-Marin, Appl. Opt. 46:1819, 2007: 0.42 to 0.45 lambda N)."""
SUN_DIAMETER: Final = 0.53
"""Degrees, from the Earth (Allen's Astrophysical Quantities, 4th ed.: 31.5 to 32.5 arc minutes over
the year)."""
SUN_SOLID_ANGLE: Final = 2 * math.pi * (1 - math.cos(math.radians(SUN_DIAMETER / 2)))
"""Steradian."""


@dataclass(frozen=True)
class Levels:
    """Illuminance of the parts of the image before glare, lux on the sensor.

    Attributes:
        panel: light of an ON pixel itself.
        face: light reflected by the panel.
        around: surroundings of the panel.
        fog: airlight, added to all three.
        halo: share of the unattenuated image that arrives blurred.
        dimmed: share of the image that arrives sharp; the other figures include it.
    """

    panel: float
    face: float
    around: float
    fog: float
    halo: float
    dimmed: float

    @property
    def on(self) -> float:
        """Illuminance in the middle of a large ON area, without glare."""
        return self.panel * (1 + self.halo / self.dimmed) + self.off

    @property
    def off(self) -> float:
        """Illuminance in the middle of a large OFF area, without glare."""
        return self.face * (1 + self.halo / self.dimmed) + self.fog


def levels(optics: Optics, air: AirSetting, effects: frozenset[str] | None = None) -> Levels:
    """Illuminance levels with these effects (`link.air.effects`), None for all."""

    def has(name: str) -> bool:
        return effects is None or name in effects

    gain = lens_gain(optics, air.distance)
    thickness = 0.0
    if air.visibility is not None:
        thickness = extinction(air.visibility, optics.wavelength_nm, air.particles) * air.distance
    dimmed = max(math.exp(-thickness), 1e-300) if has("fog extinction") else 1.0
    halo = forward_share(thickness) if has("fog blur") else 0.0
    veil = -math.expm1(-thickness) - halo if has("airlight") else 0.0
    lit = air.ambient / math.pi
    face = optics.reflectance * lit if has("ambient on the panel") else 0.0
    around = air.surroundings * lit if has("surroundings") else 0.0
    through = gain * dimmed
    return Levels(
        optics.luminance * through, face * through, around * through,
        gain * max(veil, 0.0) * airlight(air.ambient), halo, dimmed,
    )  # fmt: skip


def f_number_for(
    on_level: float, optics: Optics, distance: float, threshold: float,
    electrons_per_lux: float, clock: Clock,
) -> float:  # fmt: skip
    """F-number at which an ON pixel gives `on_level` thresholds in a tick.

    Only the panel's own light in clear air counts. The f-number in `optics` is not read.

    Args:
        on_level: charge of a tick over the threshold.
        optics: panel and lens.
        distance: distance from lens to panel, m.
        threshold: electrons.
        electrons_per_lux: electrons a second of a pixel under 1 lux.
        clock: latch clock of the camera.

    Raises:
        InputError: if no lens is fast enough.
    """
    lux = on_level * threshold * clock.hz / electrons_per_lux
    extension = lengths(optics, distance).extension
    number = math.sqrt(math.pi * optics.luminance * optics.transmission / (4 * lux)) / extension
    if not number >= FASTEST_F_NUMBER:
        most = on_level * (number / FASTEST_F_NUMBER) ** 2
        raise InputError(
            "link.aim.on_level", f"at most {at_most(most, 3)} with this panel and threshold",
            f"{on_level:g}", "give it less, link.panel.luminance more, or a lower sensor.threshold",
        )  # fmt: skip
    return number


def lens_gain(optics: Optics, distance: float) -> float:
    """Illuminance on the sensor for a luminance of 1 cd/m2, lux."""
    working = optics.f_number * lengths(optics, distance).extension
    return math.pi * optics.transmission / (4 * working**2)


def extinction(visibility: float, wavelength_nm: float, particles: Particles = "kim") -> float:
    """Extinction coefficient, 1/m, at a visibility in m."""
    if not visibility > 0:
        raise InputError("link.air.visibility", "above 0", f"{visibility:g} m", "give a length")
    db_per_km = extinction_db_per_km(visibility / 1e3, wavelength_nm, particles)
    return float(db_per_km) / DB_PER_NEPER / 1e3


def forward_share(thickness: float) -> float:
    """h, the share of a scene's light that arrives forward-scattered."""
    return thickness * math.exp(-thickness) / 2


def halo_angle(wavelength_nm: float) -> float:
    """Standard deviation of the halo along an axis, radians.

    Scattering at any point of the path counts by its distance from the panel, 1 / sqrt 3 on
    average.
    """
    return _CORE * wavelength_nm * 1e-9 / DROP / math.sqrt(3)


def airlight(illuminance: float) -> float:
    """Fog's luminance, cd/m2, under an illuminance in lux."""
    return illuminance / math.pi


def sun_lux(optics: Optics, air: AirSetting) -> float:
    """Illuminance in the sun's sharp image, lux: luminance air.sun / solid angle."""
    working = optics.f_number * lengths(optics, air.distance).extension
    return math.pi * air.sun / SUN_SOLID_ANGLE * optics.transmission / (4 * working**2)


def sun_image(optics: Optics, aim: Aim, air: AirSetting, shape: tuple[int, int]) -> Plane:
    """Illuminance of the sun's disc, (height, width) float32, lux.

    The disc is defocused as by the lens; the image is 0 if it is out of view. The edge of two
    convolved discs is approximated by an error function at the radius of the wider one, and the
    total flux is exact.
    """
    from scipy.special import erfc

    distances = lengths(optics, air.distance)
    out = np.zeros(shape, np.float32)
    away = math.atan(aim.offset[0] / distances.camera) + math.radians(air.sun_angle)
    if air.sun <= 0 or abs(away) >= math.pi / 2:
        return out
    x = (shape[1] - 1) / 2 + distances.camera * math.tan(away)
    y = (shape[0] - 1) / 2 + aim.offset[1]
    radius = distances.camera * math.tan(math.radians(SUN_DIAMETER / 2))
    blur = max(_defocus(optics, distances), 0.3)
    reach = radius + blur + 1
    if not (-reach < x < shape[1] + reach and -reach < y < shape[0] + reach):
        return out
    far = np.hypot(np.arange(shape[0])[:, None] - y, np.arange(shape[1])[None, :] - x)
    wide, narrow = max(radius, blur), min(radius, blur)
    profile = erfc((far - wide) / (narrow * 0.7)) / 2
    at = np.linspace(0, wide + 6 * narrow, 4001)
    ring = erfc((at - wide) / (narrow * 0.7)) / 2 * at
    flux = 2 * math.pi * float(((ring[1:] + ring[:-1]) / 2).sum() * (at[1] - at[0]))
    return np.asarray(profile * (sun_lux(optics, air) * math.pi * radius**2 / flux), np.float32)


def _defocus(optics: Optics, distances: Lengths) -> float:
    """Radius of the image of a point at infinity, camera pixels."""
    f = optics.focal_length
    return f / optics.f_number * (distances.image - f) / f / 2 / optics.camera_pitch


def sun_glare(optics: Optics, air: AirSetting, aim: Aim, shape: tuple[int, int]) -> float:
    """Illuminance of the sun's veiling glare on the sensor, lux.

    The lens spreads the share air.glare of the sun's light over the sensor, at any angle before the
    lens (the decrease with angle is not modelled).
    """
    away = math.radians(air.sun_angle) + math.atan(
        aim.offset[0] / lengths(optics, air.distance).camera
    )
    if air.sun <= 0 or abs(away) >= math.pi / 2:
        return 0.0
    opening = math.pi / 4 * (optics.focal_length / optics.f_number) ** 2
    sensor = shape[0] * shape[1] * optics.camera_pitch**2
    return air.glare * air.sun * math.cos(away) * opening * optics.transmission / sensor
