"""The phase of a panel's planes in the ticks of the camera, from windows of its spikes.

With a hard reset, a pixel that sees one cell hides the phase around the locked one: light of 1.4
thresholds fires in its tick for every phase within 0.28 ticks, so the pilots, whose neighbours are
unknown, carry no information there. What carries it are pixels that share their light between
cells. So all cells must be known: those of the training are, and those of data are by the
detector's decisions (decision-directed synchronisation: Mengali, D'Andrea, Synchronization
Techniques for Digital Receivers, 1997, chapter 7).
"""

from __future__ import annotations

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

_MATCH: Final = 0.15
"""Smallest correlation of the spikes with the light of the known cells."""
_NOISES: Final = (0.035, 0.05, 0.07, 0.09)
"""Noise of a spike's charge that is tried, thresholds. Too large a noise gives a biased phase."""
_REACH: Final = 0.3
"""Distance from the expected phase within which the likeliest one is taken, ticks."""
_DOUBT: Final = 0.05
"""Largest share of decisions that their soft values expect to be wrong."""


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
