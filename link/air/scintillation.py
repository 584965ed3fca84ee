"""Scintillation: turbulence makes the panel's light flicker, all of it alike.

Every point of the panel is a source of spherical waves: Rytov variance 0.4 x 1.23 Cn2 k^(7/6)
L^(11/6) (Andrews and Phillips, Laser Beam Propagation through Random Media, 2nd ed., 2005), its
index by Al-Habash, Andrews and Phillips (Opt. Eng. 40:1554, 2001), 1/a + 1/b + 1/(a b). A lens of
diameter D averages it (`aperture_averaging`; no inner scale). Weak flicker is log-normal, the rest
gamma-gamma, whose a and b are raised alike until the averaged index comes out (assumed). In time it
follows Ornstein-Uhlenbeck processes of correlation exp(-t / t_c), t_c = sqrt(wavelength L) / wind,
through the quantile functions of log-normal light or of both Gamma factors, so each symbol's factor
has exactly the law.

One factor serves the whole image. Points of a panel further apart than about the lens flicker on
their own; that all fade together is the worst case for a code that spreads its bytes over them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.streams import Stream
from link.air.motion import normal_draws

__all__ = ["Flicker", "aperture_averaging", "flicker", "gamma_gamma_shape", "rytov_spherical"]

Values = npt.NDArray[np.float64]
_PLACES: Final = 32
_WAVES: Final = 4000
"""Nodes along the path, and of spatial frequencies."""
WEAK: Final = 0.3
"""Rytov variance below which flicker is log-normal (Andrews and Phillips: weak is well below 1)."""


def rytov_spherical(structure: float, wavelength_nm: float, distance: float) -> float:
    """Variance of log-irradiance of a point source, weak turbulence, constant Cn2."""
    k = 2 * math.pi / (wavelength_nm * 1e-9)
    return 0.4 * 1.23 * structure * k ** (7 / 6) * distance ** (11 / 6)


def aperture_averaging(diameter: float, wavelength_nm: float, distance: float) -> float:
    """Index behind a lens over that at a point, weak turbulence: what the lens leaves of

        int int q^(-8/3) (1 - cos(q^2 x (1 - x))) (2 J1(q d x) / (q d x))^2 dq dx

    over its value at d = 0; x from the source in L, q in sqrt(k / L), d^2 = k D^2 / (4 L) (Andrews
    and Phillips, 2005, chapter 10). It goes to 1 / (0.214 d^(7/3)) for large lenses (Churnside,
    Appl. Opt. 30:1982, 1991); his fit 1 / (1 + 0.214 d^(7/3)) is two thirds too much at d^2 = 1.4.
    """
    from scipy.special import j1

    d = math.sqrt(2 * math.pi / (wavelength_nm * 1e-9) * diameter**2 / (4 * distance))
    x, weight = np.polynomial.legendre.leggauss(_PLACES)
    x = ((x + 1) / 2)[:, None]
    q = np.exp(np.linspace(math.log(1e-3 / max(d, 1.0)), math.log(1e3), _WAVES))
    z = np.maximum(q * d * x, 1e-9)
    each = q ** (-5 / 3) * (1 - np.cos(q**2 * x * (1 - x)))  # of d(ln q)
    seen, point = (weight @ (each * part).sum(axis=1) for part in ((2 * j1(z) / z) ** 2, 1.0))
    return float(seen / point)


def gamma_gamma_shape(variance: float) -> tuple[float, float]:
    """(a, b) of large and small eddies for a Rytov variance above 0."""
    s = variance**1.2  # sigma^(12/5)
    a = 1 / math.expm1(0.49 * variance / (1 + 1.11 * s) ** (7 / 6))
    b = 1 / math.expm1(0.51 * variance / (1 + 0.69 * s) ** (5 / 6))
    return a, b


@dataclass(frozen=True)
class Flicker:
    """index: variance of the light's factor, whose mean is 1. shape: (a, b) of gamma-gamma, None
    where it is log-normal. time: of correlation, s; infinite in still air."""

    index: float
    shape: tuple[float, float] | None
    time: float

    def factors(self, normal: Values) -> Values:
        """(n,) factors of (n, 2) standard normal numbers; log-normal needs the first alone."""
        from scipy.special import gammaincinv, ndtr

        if self.index <= 0:
            return np.ones(len(normal))
        if self.shape is None:
            variance = math.log1p(self.index)
            return np.exp(math.sqrt(variance) * normal[:, 0] - variance / 2)
        parts = [gammaincinv(s, ndtr(normal[:, n])) / s for n, s in enumerate(self.shape)]
        return np.asarray(parts[0] * parts[1], np.float64)

    def quantiles(self, chance: float) -> tuple[float, float]:
        """Factors that are passed below and above with at most this chance each."""
        from scipy.special import ndtri

        z = float(ndtri(chance if self.shape is None else chance / 2))
        low, high = self.factors(np.array([[z, z], [-z, -z]]))
        return float(low), float(high)

    def series(self, seconds: float, symbols: int, seed: int) -> Values:
        """(symbols,) factors, a symbol `seconds` after the other. seed: below 2^32."""
        draws = normal_draws(seed, Stream.SCINTILLATION, 0, symbols)
        stays = math.exp(-seconds / self.time)
        new = math.sqrt(-math.expm1(-2 * seconds / self.time))
        for n in range(1, symbols):
            draws[n] = stays * draws[n - 1] + new * draws[n]
        return self.factors(draws)


def flicker(
    structure: float, wavelength_nm: float, distance: float, diameter: float, wind: float
) -> Flicker:
    """Of a path of constant Cn2 (m^(-2/3)). distance, diameter: m. wind: m/s."""
    variance = rytov_spherical(structure, wavelength_nm, distance)
    time = math.sqrt(wavelength_nm * 1e-9 * distance) / wind if wind > 0 else math.inf
    if variance <= 0:
        return Flicker(0.0, None, time)
    averaging = aperture_averaging(diameter, wavelength_nm, distance)
    if variance < WEAK:
        return Flicker(variance * averaging, None, time)
    a, b = gamma_gamma_shape(variance)
    index = averaging * (1 / a + 1 / b + 1 / (a * b))
    # 1/(c a) + 1/(c b) + 1/(c^2 a b) = index, for c
    half = (1 / a + 1 / b) / 2
    inverse = 2 * index / (half * 2 + math.sqrt(4 * half**2 + 4 * index / (a * b)))
    return Flicker(index, (a / inverse, b / inverse), time)
