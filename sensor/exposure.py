"""From `Light` to the charge that each latch cycle adds, in Q24.40.

Within a piece of light that runs linearly from level a to level b the charge of a cycle changes by
the same amount each cycle, so a whole piece is two arrays. A cycle in which pieces meet gets the
exact sum of its parts. The arrays belong to the piece, not to the block that is being run: however
a run is split, every cycle gets the same integers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light import Box, Light, Piece, Plane
from sensor.pattern import FixedPattern
from sensor.pixel.fixed_point import Charge, to_fixed
from sensor.pixel.model import Span

__all__ = ["Exposure"]

# Products of int64 with a float64 share lose the last bits of very large charges; shrinking the
# slope by this much keeps a ramp that ends in the dark from passing below zero.
_SHRINK = 1 - 2.0**-50


@dataclass(frozen=True, eq=False)
class _Course:
    """A piece's charge: of cycle `origin`, and its change a cycle; valid in origin .. stop - 1."""

    piece: Piece
    origin: int
    stop: int
    charge: Charge
    slope: Charge | None


class Exposure:
    """Integrates light on the pixels of one plane.

    gain: photoelectrons a second for a unit of light. pattern: of these pixels. A pixel that gets
    more than LARGEST electrons a cycle is held at that (it fires in every cycle either way).
    """

    def __init__(
        self,
        clock: Clock,
        gain: float,
        pattern: FixedPattern | None = None,
    ) -> None:
        self._clock = clock
        self._per_cycle = gain * float(clock.period)
        self._pattern = (
            None if pattern is None else (pattern.gain, pattern.dark * float(clock.period))
        )
        self._levels: list[tuple[Plane, Charge]] = []
        self._courses: list[_Course] = []

    def _level(self, plane: Plane, piece: Piece) -> Charge:
        """Charge a cycle at a steady `plane`, each plane computed once."""
        for known, charge in self._levels:
            if known is plane:
                return charge
        box = piece.changed
        if box is not None and plane is piece.last:
            y0, y1, x0, x1 = box
            charge = self._level(piece.first, piece).reshape(plane.shape).copy()
            charge[y0:y1, x0:x1] = self._fixed(plane, box)
            charge = charge.ravel()
        else:
            charge = self._fixed(plane, (0, plane.shape[0], 0, plane.shape[1])).ravel()
        self._levels = [*self._levels[-2:], (plane, charge)]
        return charge

    def _fixed(self, plane: Plane, box: Box) -> Charge:
        """Charge a cycle within a box of a steady plane, fixed pattern and dark current in it."""
        y0, y1, x0, x1 = box
        light = plane[y0:y1, x0:x1]
        if not (light >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(light.min()):g}")
        electrons = light.astype(np.float64) * self._per_cycle
        if self._pattern is not None:
            gain, dark = (m.reshape(plane.shape)[y0:y1, x0:x1] for m in self._pattern)
            electrons = electrons * gain + dark
        return to_fixed(electrons)

    def _course(self, piece: Piece) -> _Course:
        for course in self._courses:
            if course.piece is piece:
                return course
        clock = self._clock
        origin = clock.cycle_at(piece.start)
        if clock.edge(origin) < piece.start:
            origin += 1
        stop = clock.cycle_at(piece.stop)
        first = self._level(piece.first, piece)
        charge, slope = first, None
        if not piece.constant:
            plane = piece.first.shape
            y0, y1, x0, x1 = piece.changed or (0, plane[0], 0, plane[1])
            last = self._level(piece.last, piece)
            change = last.reshape(plane)[y0:y1, x0:x1] - first.reshape(plane)[y0:y1, x0:x1]
            cycles = float(clock.position(piece.stop) - clock.position(piece.start))
            begun = float(origin - clock.position(piece.start))
            step = change * (_SHRINK / cycles)
            charge = first.copy()
            # astype truncates towards zero, so a falling light never passes below it
            charge.reshape(plane)[y0:y1, x0:x1] += (step * (begun + 0.5)).astype(np.int64)
            if stop - origin > 1:
                slope = np.zeros(first.shape, np.int64)
                slope.reshape(plane)[y0:y1, x0:x1] = step.astype(np.int64)
        course = _Course(piece, origin, stop, charge, slope)
        self._courses = [*self._courses[-3:], course]
        return course

    def _meeting(self, light: Light, cycle: int) -> Charge:
        """Charge of one cycle in which pieces meet."""
        clock = self._clock
        start, stop = clock.edge(cycle), clock.edge(cycle + 1)
        total: npt.NDArray[np.float64] = np.zeros(light.shape).ravel()
        for piece in light.pieces:
            a, b = max(start, piece.start), min(stop, piece.stop)
            if a >= b:
                continue
            part = ((a - piece.start) + (b - piece.start)) / (2 * (piece.stop - piece.start))
            first = self._level(piece.first, piece)
            level = first + (self._level(piece.last, piece) - first) * part
            total += level * ((b - a) / (stop - start))
        return np.rint(total).astype(np.int64)

    def spans(self, light: Light, start: int, cycles: int) -> list[Span]:
        """Spans that fill cycles `start` to `start + cycles` of the clock.

        Raises ValueError when the light does not cover them.
        """
        clock, spans, c, stop = self._clock, [], start, start + cycles
        if light.pieces[0].start > clock.edge(start) or light.pieces[-1].stop < clock.edge(stop):
            raise ValueError(
                f"light must cover {clock.edge(start)} to {clock.edge(stop)} ps, not "
                f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
            )
        while c < stop:
            piece = next(p for p in light.pieces if p.start <= clock.edge(c) < p.stop)
            if clock.edge(c + 1) > piece.stop:
                spans.append(Span(c - start, 1, self._meeting(light, c)))
                c += 1
                continue
            course = self._course(piece)
            until = min(course.stop, stop)
            spans.append(Span(c - start, until - c, course.charge, course.slope, c - course.origin))
            c = until
        return spans
