"""A measured number with its uncertainty, pixel by pixel, through every formula.

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

Values = npt.NDArray[np.float64]


def deviations(level: float) -> float:
    """Standard deviations to either side of a normal law that hold this share: 2.576 for 0.99."""
    from scipy.special import ndtri

    return float(ndtri((1 + level) / 2))


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
        """Of what each pixel gives."""
        value = float(values.mean())
        return cls(value, values - value)

    @property
    def variance(self) -> float:
        """Of the value. Pixels of a column or a row may share something (column gain, row noise):
        the largest of what pixels, columns and rows as units give is taken."""
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
