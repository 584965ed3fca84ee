"""Photon transfer: gain from the slope of variance over mean, responsivity from that of mean over
photons, saturation where the variance turns, each with its uncertainty.

Pixels are independent, and every figure of a photon transfer is a smooth function of means over
them. So each figure carries its influence: a number a pixel, of mean zero, whose mean over the
pixels is the figure's error to first order (Hampel, JASA 69:383, 1974). Sums, products and
quotients combine influences by the chain rule. That keeps all correlations by itself: of two
figures from one dark frame, of a mean with its variance, of one fixed pattern in all frames. The
variance of the figure is that of its influence over the number of pixels, so noise of any law and
variances of variances need no formula of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sensor.laboratory.bench import Bench, Stack, take_levels

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PhotonTransfer:
    """The photon transfer curve.

    Attributes:
        dark: stack under the bias alone.
        levels: stacks under rising light, to past saturation.
        saturation: number of the level with the largest variance.
        gain: K, DN/e.
        responsivity: DN/photon.
        bits: bits of a value.
        linear: share of saturation up to which slopes are fitted.
    """

    dark: Stack
    levels: tuple[Stack, ...]
    saturation: int
    gain: Estimate
    responsivity: Estimate
    bits: int
    linear: float

    @property
    def saturated_photons(self) -> float:
        """Photons at saturation."""
        return self.levels[self.saturation].photons

    @property
    def saturated_between(self) -> tuple[float, float]:
        """Photons of the levels on either side: where the peak must lie."""
        around = [self.levels[n].photons for n in (self.saturation - 1, self.saturation + 1)]
        return around[0], around[1]

    @property
    def fitted(self) -> tuple[Stack, ...]:
        """Levels that slopes are fitted to."""
        end = self.linear * self.saturated_photons
        return tuple(level for level in self.levels if level.photons <= end)

    def curve(self) -> dict[str, list[float]]:
        """For a figure: of every level, photons, mean less dark (DN), temporal variance less dark
        (DN^2), spatial deviation (DN)."""
        dark, noise = float(self.dark.mean.mean()), float(self.dark.variance.mean())
        return {
            "photons": [s.photons for s in self.levels],
            "mean": [float(s.mean.mean()) - dark for s in self.levels],
            "variance": [float(s.variance.mean()) - noise for s in self.levels],
            "spatial": [float(np.sqrt(max(s.spatial.mean(), 0))) for s in self.levels],
        }


def measure_transfer(bench: Bench) -> PhotonTransfer:
    """Takes the frames and fits both slopes, each level weighted by the inverse of its variance:
    variances of variances go with their square, means with the variance itself."""
    dark = bench.dark(bench.seconds)
    levels = tuple(take_levels(bench))
    noise = [float(s.variance.mean()) for s in levels]
    # Not the last level: only a neighbour beyond shows that the variance has turned.
    peak = int(np.argmax(noise[1:-1])) + 1
    end = bench.linear * levels[peak].photons
    used = [n for n, level in enumerate(levels) if level.photons <= end]
    mean = [Estimate.mean(levels[n].mean - dark.mean) for n in used]
    variance = [Estimate.mean(levels[n].variance - dark.variance) for n in used]
    photons = [Estimate(levels[n].photons - dark.photons, np.zeros_like(dark.mean)) for n in used]
    gain = slope_through_zero(mean, variance, [1 / noise[n] ** 2 for n in used])
    response = slope_through_zero(photons, mean, [1 / noise[n] for n in used])
    return PhotonTransfer(dark, levels, peak, gain, response, bench.pixels.bits, bench.linear)


def slope_through_zero(x: list[Estimate], y: list[Estimate], weight: list[float]) -> Estimate:
    """Weighted slope of y over x through zero, with errors of both."""
    total = sum(w * a.value**2 for w, a in zip(weight, x, strict=True))
    share = [w * a.value / total for w, a in zip(weight, x, strict=True)]
    slope = sum(s * b.value for s, b in zip(share, y, strict=True))
    influence = sum(
        (s * (b.influence - slope * a.influence) for s, a, b in zip(share, x, y, strict=True)),
        np.zeros_like(x[0].influence),
    )
    return Estimate(float(slope), influence)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A figure with the influence of every sample on it.

    Attributes:
        value: the figure.
        influence: (rows, W), see above.
    """

    value: float
    influence: Values

    @classmethod
    def mean(cls, values: Values) -> Estimate:
        """Estimate of the mean of `values`, one of each pixel."""
        value = float(values.mean())
        return cls(value, values - value)

    @property
    def variance(self) -> float:
        """Variance of the value. Pixels of a column or a row may share something (column gain, row
        noise): the largest of what pixels, columns and rows as units give is taken."""
        largest = 0.0
        for units in (self.influence.ravel(), *(self.influence.mean(axis=a) for a in (0, 1))):
            if units.size > 1:
                largest = max(largest, float((units**2).sum()) / (units.size * (units.size - 1)))
        return largest

    @property
    def deviation(self) -> float:
        return math.sqrt(self.variance)

    def limits(self, level: float) -> tuple[float, float]:
        """Confidence limits at this level."""
        half = deviations(level) * self.deviation
        return self.value - half, self.value + half

    def through(self, value: float, slope: float) -> Estimate:
        """A smooth function of it, given its value and its slope here."""
        return Estimate(value, slope * self.influence)

    def __add__(self, other: Estimate | float) -> Estimate:
        if isinstance(other, Estimate):
            return Estimate(self.value + other.value, self.influence + other.influence)
        return Estimate(self.value + other, self.influence)

    def __sub__(self, other: Estimate | float) -> Estimate:
        return self + other * -1.0

    def __mul__(self, other: Estimate | float) -> Estimate:
        if isinstance(other, Estimate):
            mine, its = other.value * self.influence, self.value * other.influence
            return Estimate(self.value * other.value, mine + its)
        return Estimate(self.value * other, self.influence * other)

    def __truediv__(self, other: Estimate | float) -> Estimate:
        if isinstance(other, Estimate):
            return self * other.through(1 / other.value, -1 / other.value**2)
        return self * (1 / other)


def deviations(level: float) -> float:
    """Standard deviations to either side of a normal law that hold this share: 2.576 for 0.99."""
    from scipy.special import ndtri

    return float(ndtri((1 + level) / 2))
