"""The sun in or near the field of view: its disc on the sensor, and its glare in the lens."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from cosim.light.light import Plane
from link.air.geometry import Lengths, lengths
from link.air.setting import Aim, AirSetting, Optics

SUN_DIAMETER: Final = 0.53
"""Degrees, from the Earth (Allen's Astrophysical Quantities, 4th ed.: 31.5 to 32.5 arc minutes over
the year)."""
SUN_SOLID_ANGLE: Final = 2 * math.pi * (1 - math.cos(math.radians(SUN_DIAMETER / 2)))
"""Steradian."""


def _defocus(optics: Optics, distances: Lengths) -> float:
    """Radius of the image of a point at infinity, camera pixels."""
    f = optics.focal_length
    return f / optics.f_number * (distances.image - f) / f / 2 / optics.camera_pitch


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
