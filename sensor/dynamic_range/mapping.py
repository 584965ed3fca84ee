"""From a chain's values to an output of few bits: linear and gamma mapping, and what of the
dynamic range is left.

An output of L = 2^bits - 1 steps shows, at the least, its first step. Mapped by y = x^(1/gamma)
that step stands for x = L^-gamma, so an output holds gamma 20 log10(L) dB: 48.1 dB linear in 8
bits, 105.9 dB with gamma 2.2. What it costs is the size of the other steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sensor.dynamic_range.decibels import decibels

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Mapping:
    """A power law from a chain's values to an output of few bits.

    Attributes:
        gamma: 1 is linear.
        bits: bits of the output.
    """

    gamma: float = 1.0
    bits: int = 8

    @property
    def steps(self) -> int:
        return (1 << self.bits) - 1

    def codes(self, light: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Output codes of values from 0 to 1 (what lies outside is clipped), rounded."""
        x = np.clip(np.asarray(light, np.float64), 0, 1)
        return np.rint(x ** (1 / self.gamma) * self.steps).astype(np.int64)

    def light(self, codes: npt.ArrayLike) -> Values:
        """Values from 0 to 1 that codes stand for."""
        return np.asarray((np.asarray(codes, np.float64) / self.steps) ** self.gamma)

    @property
    def holds(self) -> float:
        """dB from the first step to the last."""
        return self.gamma * decibels(self.steps)

    def survives(self, db: float) -> float:
        """dB left of a chain's dynamic range: the chain's, or what the output holds."""
        return min(db, self.holds)

    def step(self, light: float) -> float:
        """Size of a step at a value, relative to it: gamma/(L x^(1/gamma))."""
        return self.gamma / (self.steps * light ** (1 / self.gamma))
