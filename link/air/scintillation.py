"""Scintillation: turbulence makes the panel's light flicker, patch by patch.

Every point of the panel is a source of spherical waves: Rytov variance 0.4 x 1.23 Cn2 k^(7/6)
L^(11/6) (Andrews and Phillips, Laser Beam Propagation through Random Media, 2nd ed., 2005), its
index by Al-Habash, Andrews and Phillips (Opt. Eng. 40:1554, 2001), 1/a + 1/b + 1/(a b). A lens of
diameter D averages it (`aperture_averaging`; no inner scale). Weak flicker is log-normal, the rest
gamma-gamma, whose a and b are raised alike until the averaged index comes out (assumed). In time it
follows Ornstein-Uhlenbeck processes of correlation exp(-t / t_c), t_c = sqrt(wavelength L) / wind,
through the quantile functions of log-normal light or of both Gamma factors, so each symbol's factor
has exactly the law. That a lens wider than a Fresnel zone also makes it slower is not modelled.

Two points of the panel flicker the less alike the further they are apart, as the air that their
light goes through is not the same (scintillation anisoplanatism): at x of the path from the source
their rays are s (1 - x) apart. So the covariance is the integral of `aperture_averaging` with
J0(q u (1 - x)) in it, u = s sqrt(k / L), and a disc of sources averages as the lens does, (2 J1(q e
(1 - x)) / (q e (1 - x)))^2: by reciprocity lens and disc may change places. `patch_side` makes of
that square patches of the panel, alike within and on their own beyond (`link.air.patches`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from link.theory.scintillation import correlation_time, gamma_gamma, rytov, scintillation_index

__all__ = ["Flicker", "aperture_averaging", "flicker", "patch_side"]

Values = npt.NDArray[np.float64]
_PLACES: Final = 32
_WAVES: Final = 4000
"""Nodes along the path, and of spatial frequencies."""
_DISCS: Final = (1.0, 60.0, 24)
"""In lenses or Fresnel zones: from, to, how many. The largest is met at 7 to 16, and is flat."""
WEAK: Final = 0.3
"""Rytov variance below which flicker is log-normal (Andrews and Phillips: weak is well below 1)."""


def _averaging(d: float, discs: Values) -> Values:
    """(n,) index behind a lens d of light from discs of sources, (n,), over that of a point's light
    at a point; sizes as in `aperture_averaging`."""
    from scipy.special import j1

    x, weight = np.polynomial.legendre.leggauss(_PLACES)
    x = ((x + 1) / 2)[:, None]
    widest = max(d, float(discs.max()), 1.0)
    q = np.exp(np.linspace(math.log(1e-3 / widest), math.log(1e3), _WAVES))

    def part(size: float, near: Values) -> Values:
        z = np.maximum(q * size * near, 1e-9)
        return np.asarray((2 * j1(z) / z) ** 2)

    each = q ** (-5 / 3) * (1 - np.cos(q**2 * x * (1 - x)))  # of d(ln q)
    point = float(weight @ each.sum(axis=1))
    each *= part(d, x)
    return np.array([weight @ (each * part(e, 1 - x)).sum(axis=1) for e in discs]) / point


def _per_metre(wavelength_nm: float, distance: float) -> float:
    """sqrt(k / (4 L)): what a diameter is multiplied by."""
    return math.sqrt(2 * math.pi / (wavelength_nm * 1e-9) / (4 * distance))


@lru_cache(maxsize=64)
def aperture_averaging(
    diameter: float, wavelength_nm: float, distance: float, source: float = 0.0
) -> float:
    """Index behind a lens over that at a point, weak turbulence: what the lens leaves of

        int int q^(-8/3) (1 - cos(q^2 x (1 - x))) (2 J1(q d x) / (q d x))^2 dq dx

    over its value at d = 0; x from the source in L, q in sqrt(k / L), d^2 = k D^2 / (4 L) (Andrews
    and Phillips, 2005, chapter 10). It goes to 1 / (0.214 d^(7/3)) for large lenses (Churnside,
    Appl. Opt. 30:1982, 1991); his fit 1 / (1 + 0.214 d^(7/3)) is two thirds too much at d^2 = 1.4.
    source: diameter of a disc of sources that all show the same, m.
    """
    unit = _per_metre(wavelength_nm, distance)
    return float(_averaging(diameter * unit, np.array([source * unit]))[0])


@lru_cache(maxsize=64)
def patch_side(
    diameter: float, wavelength_nm: float, distance: float, source: float = 0.0
) -> float:
    """Side of the panel's patches, m: of a point's light about half the lens's diameter, 0.87
    sqrt(wavelength L) at a point (0.44 diameters of a lens far wider than that). source: diameter
    of the disc whose index the patches have.

    Patches of side p on their own leave p^2 / A of the variance in the mean over an area A of many.
    The side is the least at which that is no less, for a disc of any area, than theory leaves (weak
    turbulence). A very large disc has less than the patches say, A^(-7/6): far points flicker a
    little against each other.
    """
    unit = _per_metre(wavelength_nm, distance)
    d, e = diameter * unit, source * unit
    discs = max(d, e, 1.0) * np.geomspace(*_DISCS)
    left = _averaging(d, np.append(e, discs))
    return math.sqrt(float((math.pi / 4 * discs**2 * left[1:] / left[0]).max())) / unit


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


def flicker(
    structure: float, wavelength_nm: float, distance: float, diameter: float, wind: float,
    source: float = 0.0,
) -> Flicker:  # fmt: skip
    """Of a path of constant Cn2 (m^(-2/3)). distance, diameter: m. wind: m/s. source: diameter of
    the disc of sources whose light is seen together, m."""
    wavelength = wavelength_nm * 1e-9
    variance = float(rytov(structure, wavelength, distance, "spherical"))
    time = float(correlation_time(wavelength, distance, wind)) if wind > 0 else math.inf
    if variance <= 0:
        return Flicker(0.0, None, time)
    averaging = aperture_averaging(diameter, wavelength_nm, distance, source)
    if variance < WEAK:
        return Flicker(variance * averaging, None, time)
    a, b = (float(n) for n in gamma_gamma(variance))
    index = averaging * float(scintillation_index(a, b))
    # 1/(c a) + 1/(c b) + 1/(c^2 a b) = index, for c
    half = (1 / a + 1 / b) / 2
    inverse = 2 * index / (half * 2 + math.sqrt(4 * half**2 + 4 * index / (a * b)))
    return Flicker(index, (a / inverse, b / inverse), time)
