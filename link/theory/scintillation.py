"""Turbulence over a path of constant structure: strength, correlation time, law of the intensity.

Units: cn2, the refractive-index structure constant, m^(-2/3); wavelength, length, diameter, m.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
RYTOV: Final = {"plane": 1.23, "spherical": 0.4 * 1.23}
"""Andrews and Phillips, Laser Beam Propagation through Random Media, 2nd ed., section 8.2."""
LARGE: Final = (0.49, 1.11, 7 / 6)
SMALL: Final = (0.51, 0.69, 5 / 6)
"""(strength, saturation, power) of large and small eddies for a plane wave without inner scale:
Al-Habash, Andrews, Phillips, Opt. Eng. 40:1554 (2001)."""


def rytov(
    cn2: npt.ArrayLike,
    wavelength: npt.ArrayLike,
    length: npt.ArrayLike,
    wave: Literal["plane", "spherical"] = "plane",
) -> Array:
    """Rytov variance, 1.23 Cn2 k^(7/6) L^(11/6); 0.4 of it for a spherical wave."""
    k = 2 * np.pi / np.asarray(wavelength, np.float64)
    return np.asarray(RYTOV[wave] * np.asarray(cn2) * k ** (7 / 6) * np.power(length, 11 / 6))


def gamma_gamma(sigma2: npt.ArrayLike) -> tuple[Array, Array]:
    """(alpha, beta), the effective numbers of large and small eddies for a Rytov variance.

    The variance must be above 0. Both tend to 1 / (0.49 sigma2) as it tends to 0; expm1 preserves
    this, while exp(x) - 1 is 0 below 1e-16.
    """
    s = np.asarray(sigma2, np.float64)
    if not (s > 0).all():
        raise ValueError("sigma2 must be above 0: without turbulence nothing fades")
    numbers = (
        1 / np.expm1(a * s / (1 + b * s ** (6 / 5)) ** power) for a, b, power in (LARGE, SMALL)
    )
    alpha, beta = numbers
    return np.asarray(alpha), np.asarray(beta)


def scintillation_index(alpha: npt.ArrayLike, beta: npt.ArrayLike) -> Array:
    """Variance of the intensity over its squared mean, 1/alpha + 1/beta + 1/(alpha beta)."""
    a, b = np.asarray(alpha, np.float64), np.asarray(beta, np.float64)
    return np.asarray(1 / a + 1 / b + 1 / (a * b))


def correlation_time(
    wavelength: npt.ArrayLike, length: npt.ArrayLike, wind: npt.ArrayLike
) -> Array:
    """Correlation time of the intensity, s: sqrt(lambda L) / V.

    A Fresnel zone is carried past a point by the wind (Taylor's frozen flow).
    """
    zone = np.sqrt(np.asarray(wavelength, np.float64) * np.asarray(length, np.float64))
    return np.asarray(zone / np.asarray(wind, np.float64))
