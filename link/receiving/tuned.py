"""A receiver that knows a link from an earlier transmission.

A fixed panel before a fixed camera is searched once. From one transmission to the next its image
shakes by a share of a pixel, and the phase of a clock that is held moves by hundredths of a tick:
both are measured again, by the tags and by the training. What the detector has learned stays.

A detector with tables has laws for each class of the phase at which symbols begin in a tick. As
the phase drifts, each row of the camera comes into the next class at a symbol of its own. Its laws
are counted before, from the last known symbols as if they came so much later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from link.detect.counting import PHASES
from link.detect.detector import Detector
from link.detect.joint import Joint
from link.layout import TRAINING, training
from link.receiving.acquiring import Acquired, brightest_ticks, lit_span
from link.receiving.gaps import learn_known
from link.receiving.phasing import followed_delay
from link.receiving.recording import Recording
from link.receiving.refining import TagArt, shift_of
from link.timing import Registration, Timing

if TYPE_CHECKING:
    pass

_STEPS: Final = 3
"""Measurements of the displacement, each from the one before: a single one ends a twentieth of a
pixel off."""
_APART: Final = 0.05
"""Standard deviation of the phase from one transmission to the next, ticks: that of a held clock is
.01 to .02."""
_ROWS: Final = 5
"""Rows, from the first to the last, whose classes of phase are followed."""


@dataclass(frozen=True, eq=False)
class Tuned:
    """What a receiver knows of a link.

    Attributes:
        acquired: the earlier transmission, located and timed.
        detector: Detector that has learned from its training.
        met: classes of phase that it has learned.
        confidence: factor on its soft values.
    """

    acquired: Acquired
    detector: Joint
    met: ClassesMet
    confidence: float | None

    def found(self, recording: Recording) -> Acquired | None:
        """Transmission in a recording that contains its training; None if it is not where it
        was."""
        was = self.acquired
        layout, home = was.layout, was.refined
        lit = lit_span(recording, layout, home.homography)
        if lit is None:
            return None
        rates = recording.rates(*brightest_ticks(recording))
        at, tags = (0.0, 0.0), TagArt(layout)
        for _ in range(_STEPS):
            moved = shift_of(rates, home, tags, at)
            if moved is None:
                return None
            at = moved[0]
        dx, dy = at
        move = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]])
        refined = replace(home, homography=move @ home.homography)
        place = Registration(refined.homography, np.zeros((0, 3)), refined.blur)
        pace = was.pace
        pace = replace(pace, covariance=pace.covariance + np.diag([_APART**2, 0.0]))
        delay = followed_delay(
            recording, layout, place, pace.timing, was.levels, (0, training(layout))
        )
        if delay is not None:
            pace = pace.measured(pace.at, delay)
        return replace(was, refined=refined, pace=pace, lit=lit)

    def at(self, registration: Registration, timing: Timing) -> Joint | None:
        """Detector at a place and time; None if the phase falls into a class that it has not
        learned."""
        moved = self.detector.moved(registration, timing)
        met = ClassesMet(moved, timing, timing.rows, 0, TRAINING)
        return moved if met.within(self.met) else None


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
