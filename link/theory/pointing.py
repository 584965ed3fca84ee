"""A beam that does not hit the middle of an aperture: Farid and Hranilovic's law.

For a beam from a point, not for a resolved panel, whose light stays the same where its image moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Pointing"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pointing:
    """radius: of the aperture. width: of the beam at it, 1/e^2 of intensity. jitter: standard
    deviation of the miss along each axis. All m.

    Farid, Hranilovic, J. Lightwave Technol. 25:1702 (2007): the share of the beam that enters at a
    miss of r is about A0 exp(-2 r^2 / w_eq^2), good where width > 6 radius.
    """

    radius: float
    width: float
    jitter: float = 0.0

    @property
    def _v(self) -> float:
        return float(np.sqrt(np.pi) * self.radius / (np.sqrt(2) * self.width))

    @property
    def share(self) -> float:
        """A0: share that enters of a beam that hits the middle, erf(v)^2; of a square of the
        aperture's area. The circle's own is `exact_share`."""
        from scipy.special import erf

        return float(erf(self._v) ** 2)

    @property
    def exact_share(self) -> float:
        """1 - exp(-2 a^2 / w^2): a Gaussian beam through a circle."""
        return float(-np.expm1(-2 * (self.radius / self.width) ** 2))

    @property
    def equivalent_width2(self) -> float:
        """w_eq^2 = w^2 sqrt(pi) erf(v) / (2 v exp(-v^2)), m2."""
        from scipy.special import erf

        v = self._v
        return float(self.width**2 * np.sqrt(np.pi) * erf(v) / (2 * v * np.exp(-v * v)))

    @property
    def gamma2(self) -> float:
        """w_eq^2 / (4 jitter^2)."""
        return self.equivalent_width2 / (4 * self.jitter**2)

    @property
    def mean(self) -> float:
        """Mean share that enters, A0 g / (1 + g) with g = gamma2: the miss is Rayleigh."""
        return self.share if self.jitter == 0 else self.share * self.gamma2 / (1 + self.gamma2)

    def at(self, miss: npt.ArrayLike) -> Array:
        """Share that enters at a miss, m."""
        r = np.asarray(miss, np.float64)
        return np.asarray(self.share * np.exp(-2 * r * r / self.equivalent_width2))
