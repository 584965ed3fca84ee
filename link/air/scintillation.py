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
square patches of the panel, uniform within, mutually independent, and of the same law and
correlation time. Patches have edges, unlike real air. The law at a point, its course in time, and
the scintillation of large areas are correct.

Patch n (row by row) at symbol t draws two normal numbers with counter (n, 0, t, 0), so its factor
depends only on the seed, n and t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from link.air.geometry import lengths
from link.air.motion import normal_draws
from link.air.setting import AirSetting, Optics
from link.theory.air import correlation_time, gamma_gamma, rytov, scintillation_index

Values = npt.NDArray[np.float64]
_CHUNK: Final = 1 << 14
_SYMBOLS: Final = 64
"""Largest number of draws, and of symbols, that are computed at once."""
_PLACES: Final = 32
_WAVES: Final = 4000
"""Nodes along the path (_PLACES) and of spatial frequency."""
_DISCS: Final = (1.0, 60.0, 24)
"""Sizes of discs in lens diameters or Fresnel zones: from, to, count. The maximum is at 7 to 16 and
flat."""
WEAK: Final = 0.3
"""Rytov variance below which flicker is log-normal (Andrews and Phillips: weak is well below 1)."""


def flicker_of(optics: Optics, air: AirSetting) -> tuple[Flicker, Patches]:
    """Law of scintillation of what a camera pixel images, and the panel's patches.

    The field of a camera pixel is taken as a disc of equal area. Blur would average more and is
    neglected.
    """
    pixel = air.distance / lengths(optics, air.distance).camera
    optical = optics.wavelength_nm, air.distance, optics.focal_length / optics.f_number
    disc = 2 / math.sqrt(math.pi) * pixel
    law = flicker(air.structure, *optical, air.wind, disc)
    side = patch_side(optical[2], *optical[:2], disc) if law.index > 0 else math.inf
    return law, Patches((optics.height, optics.width), optics.pitch, side)


class Patches:
    """Uniform grid of patches on the panel.

    Args:
        panel: (height, width), pixels.
        pitch: pitch of the panel's pixels, m.
        side: smallest side of a patch, m; along each axis as many patches as fit, at least one.

    Attributes:
        shape: (rows, columns) of patches.
        bands: (rows + 1,) first row of the panel of each row of patches, and the end.
    """

    def __init__(self, panel: tuple[int, int], pitch: float, side: float) -> None:
        rows, columns = (
            max(min(math.floor(n * pitch / side) if side > 0 else n, n), 1) for n in panel
        )
        self.shape = rows, columns
        self.bands = np.array([n * panel[0] // rows for n in range(rows + 1)])
        self._widths = np.diff([n * panel[1] // columns for n in range(columns + 1)])

    @property
    def count(self) -> int:
        return self.shape[0] * self.shape[1]

    def columns(self, factors: Values) -> npt.NDArray[np.float32]:
        """Factors of the patches, (count,), as those of the panel's columns in each row of patches,
        (rows of patches, width)."""
        return np.repeat(factors.astype(np.float32).reshape(self.shape), self._widths, axis=1)


class FlickerSeries:
    """Factors of the patches, symbol by symbol: an Ornstein-Uhlenbeck process in each patch.

    Symbols are computed in order. A symbol before those in memory is computed from the beginning,
    with the same bits.

    Args:
        law: law of the factors.
        seconds: duration of a symbol.
        patches: number of patches.
        seed: seed below 2^32.
    """

    def __init__(self, law: Flicker, seconds: float, patches: int, seed: int) -> None:
        self._law, self._patches, self._seed = law, patches, seed
        self._decay = math.exp(-seconds / law.time)
        self._gain = math.sqrt(-math.expm1(-2 * seconds / law.time))
        self._step = max(min(_CHUNK // patches, _SYMBOLS), 1)
        self._constant = np.ones(patches)
        self._first, self._last = 0, np.zeros((patches, 2))
        self._factors = np.zeros((0, patches))

    def __getitem__(self, symbol: int) -> Values:
        """Factors of a symbol, (patches,) float64."""
        if symbol < 0:
            raise IndexError(f"symbol must be 0 or more, not {symbol}")
        if self._law.index <= 0:
            return self._constant
        if symbol < self._first:
            self._first, self._factors = 0, self._factors[:0]
        while symbol >= self._first + len(self._factors):
            self._advance()
        return np.asarray(self._factors[symbol - self._first])

    def _advance(self) -> None:
        """Computes the next symbols."""
        first = self._first + len(self._factors)
        draws = normal_draws(
            self._seed, Stream.SCINTILLATION, np.arange(self._patches), self._step, first
        )
        for n in range(self._step):
            if first + n:  # the first symbol has the stationary law
                draws[n] = self._decay * self._last + self._gain * draws[n]
            self._last = draws[n]
        factors = self._law.factors(draws.reshape(-1, 2))
        self._first, self._factors = first, factors.reshape(self._step, self._patches)


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
