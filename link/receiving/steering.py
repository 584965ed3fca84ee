"""Steering of a camera's clock to the panel: the control law, and the phase that it holds.

The phase x is measured once in an interval, and a correction takes effect in the next one, so the
loop predicts over two intervals. With the filter of Kalata (IEEE Trans. AES 20:174, 1984; Brookner,
Tracking and Kalman Filtering, 1998, section 1.2) and d the drift of an interval, after a
measurement that differs by r from the predicted phase

    x += alpha r,   d += beta r,   x' = x + d - v,   v' = x' + d,

where v is the correction of the current interval, x' the phase at the next one's begin and v' the
next one's correction. The error of the lock is that of a prediction over two intervals. The poles
z^2 - (2 - alpha - beta) z + 1 - alpha are those of a natural frequency w and a damping c, z =
exp((-c +- i sqrt(1 - c^2)) w). A constant drift leaves no error.

With a hard reset, a pixel that sees one cell hides the phase around the locked one: light of 1.4
thresholds fires in its tick for every phase within 0.28 ticks, so the pilots, whose neighbours are
unknown, carry no information there. What carries it are pixels that share their light between
cells. So all cells must be known: those of the training are, and those of data are by the
detector's decisions (decision-directed synchronisation: Mengali, D'Andrea, Synchronization
Techniques for Digital Receivers, 1997, chapter 7).
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.detect.catalogue import make_detector
from link.detect.detector import Detector
from link.layout import Layout, training
from link.receiving.pacing import Delay
from link.receiving.phasing import fit_phase, fit_timing, measure_delay
from link.receiving.pilots.clocking import clock_by_pilots
from link.receiving.pilots.sequence import pilot_signal
from link.receiving.recording import Recording
from link.receiving.synthesis import Levels, Witnesses, choose_witnesses, known_cells, match
from link.timing import Registration, Timing

_UNKNOWN: Final = (0.3, 0.005)
"""Standard deviations of the phase and of the drift before the first measurement, ticks: of any
phase, and of two clocks of 30 parts per million each in an interval of 128 ticks."""
_MATCH: Final = 0.15
"""Smallest correlation of the spikes with the light of the known cells."""
_NOISES: Final = (0.035, 0.05, 0.07, 0.09)
"""Noise of a spike's charge that is tried, thresholds. Too large a noise gives a biased phase."""
_REACH: Final = 0.3
"""Distance from the expected phase within which the likeliest one is taken, ticks."""
_DOUBT: Final = 0.05
"""Largest share of decisions that their soft values expect to be wrong."""


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


@dataclass(frozen=True)
class Acquisition:
    """What a search without any knowledge of the phase gives.

    Attributes:
        timing: timing of the symbols of the training.
        levels: light of the cells.
    """

    timing: Timing
    levels: Levels


class PhaseDetector:
    """Measures the phase in windows of a recording.

    Args:
        layout: layout of the mode.
        detector: name of the detector that decides data.
        registration: registration of the panel in the image.

    Attributes:
        training: (symbols, cells) bits of the training.
    """

    def __init__(self, layout: Layout, detector: str, registration: Registration) -> None:
        self._layout, self._name, self._registration = layout, detector, registration
        self.training = training(layout)
        self._decides: Detector | None = None

    def copied(self) -> PhaseDetector:
        """A detector that has learned the same, for another thread."""
        other = copy(self)
        other._decides = copy(self._decides)
        return other

    def acquire(self, recording: Recording, lit: tuple[int, int]) -> Acquisition | None:
        """Timing of a recording that contains the training; None if its pilots are not visible.
        lit: ticks in which the panel is on. The timing is best in the training's middle: its period
        is not known better than the training tells."""
        layout, registration = self._layout, self._registration
        signal = pilot_signal(recording, layout, registration.homography)
        if signal is None:
            return None
        clocking = clock_by_pilots(signal, layout, recording.shape[0], lit)
        if clocking is None:
            return None
        known = known_cells(layout, 0, self.training)
        rough = clocking.timing
        w = choose_witnesses(recording, layout, registration, rough, known)
        if w is None or match(w, rough) < _MATCH:
            return None
        fit = fit_timing(w, rough, clocking.span)
        return Acquisition(fit.timing, fit.levels)

    def learn(self, recording: Recording, timing: Timing) -> None:
        """Learns to decide data from a recording of the training at its known timing."""
        made = make_detector(self._name, self._layout, self._registration, timing)
        made.learn(recording.words, recording.first, self.training, 0)
        self._decides = made

    def trained(
        self, recording: Recording, timing: Timing, levels: Levels, count: int
    ) -> tuple[Delay, Levels] | None:
        """Delay of the training's first `count` symbols against an expected timing, and the levels
        that they show; None if they are not visible."""
        w = self._witnesses(recording, timing, self.training[:count])
        if w is None:
            return None
        tried = [fit_phase(w, timing, replace(levels, noise=noise), _REACH) for noise in _NOISES]
        return max(tried, key=lambda one: one[1].likelihood)

    def decided(
        self, recording: Recording, timing: Timing, levels: Levels, count: int
    ) -> Delay | None:
        """Delay of `count` symbols of data against an expected timing, by their decisions; None if
        too many of these are doubtful. Wrong decisions favour the expected phase.

        Raises ValueError before `learn`.
        """
        if self._decides is None:
            raise ValueError("data cannot be decided before the training was learned")
        soft = self._decides.soft(recording.words, recording.first, 0, count, recording.stop)
        if float(np.mean(1 / (1 + np.exp(np.abs(soft.astype(np.float64)))))) > _DOUBT:
            return None
        w = self._witnesses(recording, timing, soft > 0)
        return None if w is None else measure_delay(w, timing, levels, _REACH)

    def _witnesses(
        self, recording: Recording, timing: Timing, data: npt.NDArray[np.bool_]
    ) -> Witnesses | None:
        """Pixels around cells of known bits; None if they do not show them."""
        known = known_cells(self._layout, 0, data)
        w = choose_witnesses(recording, self._layout, self._registration, timing, known, pure=False)
        return None if w is None or match(w, timing) < _MATCH else w
