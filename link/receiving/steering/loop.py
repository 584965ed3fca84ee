"""The control law of the phase: a digital phase-locked loop of second order.

The phase x is measured once in an interval, and a correction takes effect in the next one, so the
loop predicts over two intervals. With the filter of Kalata (IEEE Trans. AES 20:174, 1984; Brookner,
Tracking and Kalman Filtering, 1998, section 1.2) and d the drift of an interval, after a
measurement that differs by r from the predicted phase

    x += alpha r,   d += beta r,   x' = x + d - v,   v' = x' + d,

where v is the correction of the current interval, x' the phase at the next one's begin and v' the
next one's correction. The error of the lock is that of a prediction over two intervals. The poles
z^2 - (2 - alpha - beta) z + 1 - alpha are those of a natural frequency w and a damping c, z =
exp((-c +- i sqrt(1 - c^2)) w). A constant drift leaves no error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np


@dataclass(frozen=True)
class LoopGains:
    """Gains of the filter; see above.

    Attributes:
        alpha: share of a difference that moves the phase.
        beta: share of it that moves the drift of an interval.
    """

    alpha: float
    beta: float

    @classmethod
    def of(cls, frequency: float, damping: float) -> LoopGains:
        """Gains of a natural frequency, radians an interval, and a damping up to 1."""
        gone = math.exp(-damping * frequency)
        turn = math.cos(frequency * math.sqrt(1 - damping**2))
        alpha = 1 - gone**2
        return cls(alpha, 2 - alpha - 2 * gone * turn)

    @property
    def noise(self) -> float:
        """Variance of the lock's error over that of independent measurements: of x + 2 d, with the
        covariance of the filter in its steady state (Kalata 1984)."""
        a, b = self.alpha, self.beta
        both = 2 * a**2 + 2 * b - 3 * a * b, b * (2 * a - b), 2 * b**2
        return (both[0] + 4 * both[1] + 4 * both[2]) / (a * (4 - 2 * a - b))

    @property
    def bandwidth(self) -> float:
        """Noise bandwidth, one-sided, cycles an interval: white noise of this band has `noise`."""
        return self.noise / 2

    @property
    def lag(self) -> float:
        """Error of the lock, in intervals^2, per acceleration: drift that grows by a an interval
        leaves the error a ((1 + alpha) / beta + 1)."""
        return (1 + self.alpha) / self.beta + 1


GAINS: Final = LoopGains.of(0.25, math.sqrt(0.5))
"""Gains of the loop: 25 intervals a period, damped so that the response has no peak."""


_UNKNOWN: Final = (0.3, 0.005)
"""Standard deviations of the phase and of the drift before the first measurement, ticks: of any
phase, and of two clocks of 30 parts per million each in an interval of 128 ticks."""


def centred(phase: float) -> float:
    """A phase modulo a tick, from -1/2 to 1/2."""
    return phase - math.floor(phase + 0.5)


class PhaseLoop:
    """The state of the loop, interval by interval.

    Args:
        longer, shorter: ticks by which all ticks of an interval together may be lengthened and
            shortened.
        gains: gains in the steady state.

    Attributes:
        phase: phase of the planes after the ticks, at the begin of the current interval, ticks.
        drift: growth of the phase in an interval without correction, ticks.
        correction: ticks by which the current interval is longer.
    """

    def __init__(self, longer: float, shorter: float, gains: LoopGains = GAINS) -> None:
        self._longer, self._shorter, self._gains = longer, shorter, gains
        self.phase = self.drift = self.correction = 0.0
        self._covariance = np.diag(np.square(_UNKNOWN))

    @property
    def growth(self) -> float:
        """Expected change of the phase within the current interval, ticks."""
        return self.drift - self.correction

    def step(self, measured: float | None, error: float = 0.0) -> None:
        """Goes to the next interval.

        The first gains are those of a Kalman filter, until the steady ones are larger. A phase that
        cannot be reached by shortening is reached by lengthening: planes are alike, and only their
        number changes.

        Args:
            measured: phase at the begin of the current interval, ticks; None for no measurement.
            error: its standard error, ticks.
        """
        if measured is not None:
            known = self._covariance
            share = known[:, 0] / (known[0, 0] + error**2)
            self._covariance = known - np.outer(share, known[0])
            off = centred(measured - self.phase)
            self.phase += max(self._gains.alpha, float(share[0])) * off
            self.drift += max(self._gains.beta, float(share[1])) * off
        move = np.array([[1.0, 1.0], [0.0, 1.0]])
        self._covariance = move @ self._covariance @ move.T
        self.phase += self.growth
        wanted = self.phase + self.drift
        if wanted < -self._shorter and wanted + 1 <= self._longer:
            self.phase, wanted = self.phase + 1, wanted + 1
        self.correction = min(max(wanted, -self._shorter), self._longer)
