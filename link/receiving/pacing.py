"""The symbols' pace through a recording: a line through all looks at how late they are.

Kalman's filter (J. Basic Eng. 82:35, 1960) of two numbers, how late symbols are and how fast that
grows. A look far from the others tells the period best: one over 91 ticks tells it to a hundred
parts per million, four over 500 ticks to thirty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.timing import Timing

__all__ = ["Delay", "Pace"]

Floats = npt.NDArray[np.float64]
_MODEL: Final = 0.01
"""Ticks by which looks differ that chance does not explain: of the model of a pixel. Assumed; looks
at one recording with the true timing scattered by .003, all of them .05 late."""
_HALF: Final = 4096.0
"""Ticks in which what was seen comes to count half: clocks wander."""
_LIMIT: Final = 3.0
"""Standard errors that are told as the limit."""


@dataclass(frozen=True)
class Delay:
    """Ticks by which symbols are late, and the standard error of chance."""

    late: float
    error: float


@dataclass(frozen=True, eq=False)
class Pace:
    """timing, as it is known by tick `at`. unsure: (2, 2) covariance of the lateness there, ticks,
    and of its growth, ticks a tick."""

    timing: Timing
    at: float
    unsure: Floats

    @classmethod
    def fitted(cls, timing: Timing, at: float, ticks: int, drift: float) -> Pace:
        """Of a fit to so many ticks about `at`, whose period has the standard error `drift`."""
        growth = drift**2 + (_MODEL / ticks) ** 2
        return cls(timing, at, np.diag([_MODEL**2, growth]))

    @property
    def limit(self) -> float:
        """Parts per million by which the period may be off."""
        return _LIMIT * float(np.sqrt(self.unsure[1, 1])) * 1e6

    def measured(self, tick: float, delay: Delay) -> Pace:
        """After a look at a tick: what it says weighs by how sure it is."""
        passed = tick - self.at
        move = np.array([[1.0, passed], [0.0, 1.0]])
        unsure = move @ self.unsure @ move.T * 2.0 ** (abs(passed) / _HALF)
        share = unsure[:, 0] / (unsure[0, 0] + delay.error**2 + _MODEL**2)
        unsure = unsure - np.outer(share, unsure[0])
        late, growth = share * delay.late
        t = self.timing
        symbols = (tick - t.first) / t.period
        period = t.period * (1 + float(growth))
        first = t.first + float(late) + symbols * (t.period - period)
        return Pace(replace(t, first=first, period=period), tick, (unsure + unsure.T) / 2)
