"""Fog: what it takes from a light, what it adds of its own, and how it spreads it.

Extinction by visibility V at 5 % contrast, a = (3.91 / V) (wavelength / 550 nm)^-q: Kim, McArthur
and Korevaar, SPIE 4214:26 (2001), and Kruse, McGlauchlin and McQuistan (1962). Light that reaches
the lens past thickness t = a d is L e^-t + h H + A (1 - e^-t - h) (Koschmieder's airlight): A is
the fog's own luminance, E / pi under E lux from all sides, its drops taken to absorb nothing. h, H:
what is scattered forward, once, and arrives spread out. Drops far larger than the wavelength
diffract half of what they take (van de Hulst, Light Scattering by Small Particles, 1957, 8.2 and
8.3), so h = t e^-t / 2; H is L blurred by that diffraction, of drops of 10 um (assumed; radiation
fog has 4 to 40 um), a Gaussian of the Airy disc's core.
"""

from __future__ import annotations

import math
from typing import Final

from cosim import InputError

__all__ = ["airlight", "extinction", "forward_share", "halo_angle"]

CONTRAST: Final = 3.91
"""-ln 0.02, as both laws have it."""
DROP: Final = 10e-6
"""Diameter of a drop, m: assumed."""
_CORE: Final = 0.42
"""Standard deviation of the Gaussian that fits an Airy core, wavelengths over the aperture (Zhang,
Zerubia and Olivo-Marin, Appl. Opt. 46:1819, 2007: 0.42 to 0.45 lambda N)."""


def extinction(visibility: float, wavelength_nm: float, particles: str = "kim") -> float:
    """Per metre. visibility: m."""
    if not visibility > 0:
        raise InputError("link.air.visibility", "above 0", f"{visibility:g} m", "give a length")
    km = visibility / 1000
    if km > 50:
        q = 1.6
    elif km > 6:
        q = 1.3
    elif particles == "kruse":
        q = 0.585 * km ** (1 / 3)
    elif km > 1:
        q = 0.16 * km + 0.34
    else:
        q = max(km - 0.5, 0.0)
    return CONTRAST / visibility * (wavelength_nm / 550) ** -q


def forward_share(thickness: float) -> float:
    """h: share of a scene's light that arrives spread out."""
    return thickness * math.exp(-thickness) / 2


def halo_angle(wavelength_nm: float) -> float:
    """Standard deviation along an axis, radians: scattering anywhere on the way counts by how far
    it is from the panel, 1 / sqrt 3 in the mean."""
    return _CORE * wavelength_nm * 1e-9 / DROP / math.sqrt(3)


def airlight(illuminance: float) -> float:
    """The fog's own luminance, cd/m2."""
    return illuminance / math.pi
