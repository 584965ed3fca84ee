"""Attenuation of light in fog and haze, by visibility."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

Particles = Literal["kim", "kruse"]
PRINTED: Final = 3.91
"""-ln 0.02, Koschmieder at a contrast of 2 %, as printed by Kim (exact: 3.912)."""
DB_PER_NEPER: Final = 10 / np.log(10)
REFERENCE_NM: Final = 550.0
"""Wavelength that visibility refers to, nm."""
Array = npt.NDArray[np.float64]


def size_exponent(visibility_km: npt.ArrayLike, particles: Particles = "kim") -> Array:
    """q of extinction ~ wavelength^-q.

    Kim, McArthur, Korevaar, SPIE 4214:26 (2001): 1.6 above 50 km, 1.3 from 6, 0.16 V + 0.34 from 1,
    V - 0.5 from 0.5, 0 below, where fog is grey. Kruse, McGlauchlin, McQuistan, Elements of
    Infrared Technology (1962): 0.585 V^(1/3) below 6 km.
    """
    v = np.asarray(visibility_km, np.float64)
    if not (v > 0).all():
        raise ValueError("visibility must be above 0")
    if particles == "kruse":
        return np.select([v > 50, v > 6], [1.6, 1.3], 0.585 * np.cbrt(v))
    return np.select([v > 50, v > 6, v > 1, v > 0.5], [1.6, 1.3, 0.16 * v + 0.34, v - 0.5], 0.0)


def extinction_db_per_km(
    visibility_km: npt.ArrayLike, wavelength_nm: npt.ArrayLike, particles: Particles = "kim"
) -> Array:
    """Attenuation, dB/km: 4.343 (3.91 / V) (wavelength / 550 nm)^-q.

    ITU-R P.1814 equation 4 omits the factor 4.343 and calls the result dB; it is in nepers.
    """
    v, nm = np.asarray(visibility_km, np.float64), np.asarray(wavelength_nm, np.float64)
    q = size_exponent(v, particles)
    return np.asarray(DB_PER_NEPER * PRINTED / v * (nm / REFERENCE_NM) ** -q)
