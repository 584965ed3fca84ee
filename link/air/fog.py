"""Fog: what it takes from a light, what it adds of its own, and how it spreads it.

Extinction a by visibility is Kim's or Kruse's (`link.theory.extinction`). Light that reaches the
lens past thickness t = a d is L e^-t + h H + A (1 - e^-t - h) (Koschmieder's airlight): A is
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
from link.theory.extinction import DB_PER_NEPER, Particles, extinction_db_per_km

__all__ = ["airlight", "extinction", "forward_share", "halo_angle"]

DROP: Final = 10e-6
"""Diameter of a drop, m: assumed."""
_CORE: Final = 0.42
"""Standard deviation of the Gaussian that fits an Airy core, wavelengths over the aperture (Zhang,
Zerubia and Olivo-Marin, Appl. Opt. 46:1819, 2007: 0.42 to 0.45 lambda N)."""


def extinction(visibility: float, wavelength_nm: float, particles: Particles = "kim") -> float:
    """Per metre. visibility: m."""
    if not visibility > 0:
        raise InputError("link.air.visibility", "above 0", f"{visibility:g} m", "give a length")
    db_per_km = extinction_db_per_km(visibility / 1e3, wavelength_nm, particles)
    return float(db_per_km) / DB_PER_NEPER / 1e3


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
