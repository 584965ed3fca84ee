"""The classes of phase that a detector has learned, and those that it will need.

A detector with tables has laws for each class of the phase at which symbols begin in a tick. As
the phase drifts, each row of the camera comes into the next class at a symbol of its own. Its laws
are counted before, from the last known symbols as if they came so much later.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.detect.counting import PHASES
from link.detect.detector import Detector
from link.detect.joint import Joint
from link.receiving.gaps import learn_known
from link.receiving.recording import Recording
from link.timing import Timing

_ROWS: Final = 5
"""Rows, from the first to the last, whose classes of phase are followed."""


class ClassesMet:
    """Rows, of _ROWS, and the classes of phase that a detector has learned in them.

    Args:
        detector: detector that has learned from `count` symbols from `first` on.
        timing: timing of the detector.
        rows: number of rows of the camera.
        first, count: the symbols.
    """

    def __init__(
        self, detector: Detector, timing: Timing, rows: int, first: int, count: int
    ) -> None:
        self.timing, self._rows = timing, rows
        self._delay = detector.delay if isinstance(detector, Joint) else 0.0
        self._met = self._of(first, count)

    def _of(self, first: int, count: int) -> set[tuple[int, int]]:
        row = np.linspace(0, self._rows, _ROWS)[:, None]
        start = self.timing.start(first + np.arange(count), row) + self._delay
        phase = np.floor((start - np.floor(start)) * PHASES).astype(int)
        return {(n, int(each)) for n, some in enumerate(phase) for each in np.unique(some)}

    def has(self, first: int, count: int) -> bool:
        """Whether all classes of `count` symbols from `first` on are among them."""
        return self._of(first, count) <= self._met

    def within(self, other: ClassesMet) -> bool:
        """Whether another one has met all of these classes."""
        return self._met <= other._met

    def add(self, first: int, count: int) -> None:
        """Adds the classes of symbols."""
        self._met |= self._of(first, count)

    def learn_ahead(
        self, recording: Recording, detector: Detector, known: tuple[int, npt.NDArray[np.bool_]],
        first: int, count: int,
    ) -> None:  # fmt: skip
        """Has the detector learn the classes that `count` symbols fall into and that it has not
        met. known: the first of the last known symbols, and their bits."""
        if not isinstance(detector, Joint) or self.has(first, count):
            return
        begin, bits = known
        drift = self.timing.period - detector.ticks
        late = drift * (first + count - begin - len(bits))
        learn_known(detector, recording, self.timing, bits, begin, late)
        self.add(first, count)
