"""The pace of symbols through a recording: a line through all measurements of their delay.

A Kalman filter (J. Basic Eng. 82:35, 1960) of the delay and its growth. A measurement far from the
others determines the period best: one over 91 ticks gives it to a hundred parts per million, four
over 500 ticks to thirty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.timing import Timing

Floats = npt.NDArray[np.float64]
_MODEL: Final = 0.01
"""Systematic error of a measurement, of the model of a pixel, ticks. Assumed; measurements of one
recording with the true timing scatter by 0.003 and are all biased by 0.05."""
_HALF: Final = 4096.0
"""Ticks after which a measurement counts half, since clocks drift."""
_LIMIT: Final = 3.0
"""Standard errors in the reported limit."""


@dataclass(frozen=True)
class Delay:
    """A measured delay of the symbols.

    Attributes:
        ticks: delay, ticks.
        error: standard error by chance, ticks.
    """

    ticks: float
    error: float


@dataclass(frozen=True, eq=False)
class Pace:
    """The timing, and its uncertainty.

    Attributes:
        timing: estimate at tick `at`.
        at: tick.
        covariance: (2, 2) of the delay, ticks, and of its growth, ticks a tick.
    """

    timing: Timing
    at: float
    covariance: Floats

    @classmethod
    def fitted(cls, timing: Timing, at: float, ticks: int, drift: float) -> Pace:
        """Pace of a fit.

        Args:
            timing: the fitted timing.
            at: middle of the fit, tick.
            ticks: length of the fit.
            drift: standard error of the period.
        """
        growth = drift**2 + (_MODEL / ticks) ** 2
        return cls(timing, at, np.diag([_MODEL**2, growth]))

    @property
    def limit(self) -> float:
        """Largest plausible error of the period, parts per million."""
        return _LIMIT * float(np.sqrt(self.covariance[1, 1])) * 1e6

    def measured(self, tick: float, delay: Delay) -> Pace:
        """Pace after a measurement at a tick, weighted by its error."""
        passed = tick - self.at
        move = np.array([[1.0, passed], [0.0, 1.0]])
        covariance = move @ self.covariance @ move.T * 2.0 ** (abs(passed) / _HALF)
        share = covariance[:, 0] / (covariance[0, 0] + delay.error**2 + _MODEL**2)
        covariance = covariance - np.outer(share, covariance[0])
        change, growth = share * delay.ticks
        t = self.timing
        symbols = (tick - t.first) / t.period
        period = t.period * (1 + float(growth))
        first = t.first + float(change) + symbols * (t.period - period)
        return Pace(replace(t, first=first, period=period), tick, (covariance + covariance.T) / 2)
