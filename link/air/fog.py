"""Fog: attenuation, airlight and forward scattering.

The extinction coefficient a follows from visibility by Kim's or Kruse's law
(`link.theory.extinction`). Light that reaches the lens through optical thickness t = a d is L e^-t
+ h H + A (1 - e^-t - h) (Koschmieder's airlight). A is the fog's luminance, E / pi under an
illuminance E from all sides, for drops that absorb nothing. h is the share of singly
forward-scattered light and H its blurred image. Drops much larger than the wavelength diffract half
of the light that they remove (van de Hulst, Light Scattering by Small Particles, 1957, 8.2 and
8.3), so h = t e^-t / 2. H is L blurred by the diffraction of drops of 10 um (assumed; radiation fog
has 4 to 40 um), with a Gaussian that fits the Airy core.
"""

from __future__ import annotations

import math
from typing import Final

from cosim import InputError
from link.theory.extinction import DB_PER_NEPER, Particles, extinction_db_per_km

DROP: Final = 10e-6
"""Diameter of a drop, m (assumed)."""
_CORE: Final = 0.42
"""Standard deviation of the Gaussian that fits an Airy core, in wavelength over aperture (Zhang,
Zerubia and Olivo-Marin, Appl. Opt. 46:1819, 2007: 0.42 to 0.45 lambda N)."""


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
