"""Scintillation: turbulence modulates the panel's light, patch by patch.

Every point of the panel emits a spherical wave of Rytov variance 0.4 x 1.23 Cn2 k^(7/6) L^(11/6)
(Andrews and Phillips, Laser Beam Propagation through Random Media, 2nd ed., 2005). The index is 1/a
+ 1/b + 1/(a b) (Al-Habash, Andrews and Phillips, Opt. Eng. 40:1554, 2001). A lens of diameter D
averages it (`aperture_averaging`; no inner scale). Weak scintillation is log-normal. Otherwise it
is gamma-gamma, whose a and b are scaled alike to match the averaged index (assumed). In time it
follows Ornstein-Uhlenbeck processes with correlation exp(-t / t_c), t_c = sqrt(wavelength L) /
wind, mapped through the quantile functions of the log-normal law or of both gamma factors, so each
symbol's factor has exactly the law. A lens wider than a Fresnel zone also slows it; this is not
modelled.

The correlation between two points of the panel falls with their distance s, because their light
passes through different air (scintillation anisoplanatism): at x of the path from the source their
rays are s (1 - x) apart. The covariance is the integral of `aperture_averaging` with an additional
J0(q u (1 - x)), u = s sqrt(k / L). A disc of sources averages as a lens does, by (2 J1(q e (1 - x))
/ (q e (1 - x)))^2: by reciprocity lens and disc can be exchanged. `patch_side` turns this into
square patches of the panel, uniform within and mutually independent (`link.air.patches`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from link.theory.scintillation import correlation_time, gamma_gamma, rytov, scintillation_index

Values = npt.NDArray[np.float64]
_PLACES: Final = 32
_WAVES: Final = 4000
"""Nodes along the path (_PLACES) and of spatial frequency."""
_DISCS: Final = (1.0, 60.0, 24)
"""Sizes of discs in lens diameters or Fresnel zones: from, to, count. The maximum is at 7 to 16 and
flat."""
WEAK: Final = 0.3
"""Rytov variance below which flicker is log-normal (Andrews and Phillips: weak is well below 1)."""


def _averaging(d: float, discs: Values) -> Values:
    """Index of light from discs of sources behind a lens, (n,), over that of a point.

    Args:
        d: diameter of the lens, as in `aperture_averaging`.
        discs: (n,) diameters of the discs of sources, in the same unit.
    """
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
    """sqrt(k / (4 L)), which converts diameters in m to the dimensionless d."""
    return math.sqrt(2 * math.pi / (wavelength_nm * 1e-9) / (4 * distance))


@lru_cache(maxsize=64)
def aperture_averaging(
    diameter: float, wavelength_nm: float, distance: float, source: float = 0.0
) -> float:
    """Index behind a lens over that at a point, for weak turbulence.

    It is the ratio of

        int int q^(-8/3) (1 - cos(q^2 x (1 - x))) (2 J1(q d x) / (q d x))^2 dq dx

    to its value at d = 0; x from the source in L, q in sqrt(k / L), d^2 = k D^2 / (4 L) (Andrews
    and Phillips, 2005, chapter 10). For large lenses it tends to 1 / (0.214 d^(7/3)) (Churnside,
    Appl. Opt. 30:1982, 1991); his fit 1 / (1 + 0.214 d^(7/3)) is too large by two thirds at d^2 =
    1.4.

    Args:
        diameter: diameter of the lens, m.
        wavelength_nm: nm.
        distance: m.
        source: diameter of a disc of sources that show the same, m.
    """
    unit = _per_metre(wavelength_nm, distance)
    return float(_averaging(diameter * unit, np.array([source * unit]))[0])


@lru_cache(maxsize=64)
def patch_side(
    diameter: float, wavelength_nm: float, distance: float, source: float = 0.0
) -> float:
    """Side of the panel's patches, m.

    For a point source it is about half the diameter of the lens: 0.87 sqrt(wavelength L) for a
    point aperture, 0.44 diameters for a lens much wider than that.

    Independent patches of side p leave p^2 / A of the variance in the mean over an area A of many
    patches. The side is the smallest at which this is at least what theory leaves, for a disc of
    any area (weak turbulence). For a very large disc the patches leave too little, since theory
    falls as A^(-7/6): distant points are weakly anticorrelated.

    Args:
        diameter, wavelength_nm, distance: diameter, wavelength and distance as in
            `aperture_averaging`.
        source: diameter of the disc of sources whose index the patches have, m.
    """
    unit = _per_metre(wavelength_nm, distance)
    d, e = diameter * unit, source * unit
    discs = max(d, e, 1.0) * np.geomspace(*_DISCS)
    left = _averaging(d, np.append(e, discs))
    return math.sqrt(float((math.pi / 4 * discs**2 * left[1:] / left[0]).max())) / unit


@dataclass(frozen=True)
class Flicker:
    """Law of the factor of the light, whose mean is 1.

    Attributes:
        index: variance of the factor.
        shape: (a, b) of the gamma-gamma law, None for a log-normal law.
        time: correlation time, s; infinite in still air.
    """

    index: float
    shape: tuple[float, float] | None
    time: float

    def factors(self, normal: Values) -> Values:
        """(n,) factors from (n, 2) standard normal numbers; a log-normal law reads only the
        first."""
        from scipy.special import gammaincinv, ndtr

        if self.index <= 0:
            return np.ones(len(normal))
        if self.shape is None:
            variance = math.log1p(self.index)
            return np.exp(math.sqrt(variance) * normal[:, 0] - variance / 2)
        parts = [gammaincinv(s, ndtr(normal[:, n])) / s for n, s in enumerate(self.shape)]
        return np.asarray(parts[0] * parts[1], np.float64)


def flicker(
    structure: float, wavelength_nm: float, distance: float, diameter: float, wind: float,
    source: float = 0.0,
) -> Flicker:  # fmt: skip
    """Law of scintillation over a path of constant Cn2.

    Args:
        structure: Cn2, m^(-2/3).
        wavelength_nm: nm.
        distance, diameter: length of the path and diameter of the lens, m.
        wind: m/s.
        source: diameter of the disc of sources that a camera pixel averages, m.
    """
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
    # Solve 1/(c a) + 1/(c b) + 1/(c^2 a b) = index for c.
    half = (1 / a + 1 / b) / 2
    inverse = 2 * index / (half * 2 + math.sqrt(4 * half**2 + 4 * index / (a * b)))
    return Flicker(index, (a / inverse, b / inverse), time)
