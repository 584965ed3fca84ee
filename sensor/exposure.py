"""From `Light` to the charge that each latch cycle adds, in Q24.40.

Within a piece of light that runs linearly from level a to level b the charge of a cycle changes by
the same amount each cycle, so a whole piece is two arrays. A cycle in which pieces meet gets the
exact sum of its parts. Rows that are sampled at different instants meet the end of a piece in
different cycles; those cycles are summed row by row. The arrays belong to the piece, not to the
block that is being run: however a run is split, every cycle gets the same integers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light import Box, Light, Piece, Plane
from sensor.pattern import FixedPattern
from sensor.pixel.fixed_point import LARGEST, ONE, Charge, to_fixed
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

    gain: photoelectrons a second for a unit of light. pattern: of these pixels. offsets: (H,) int64
    picoseconds from a clock edge to the instant at which each row is sampled, None for all at the
    edge. Before instant 0 the light is taken as it is then. A pixel that gets more than LARGEST
    electrons in a cycle is held at that (it fires in every cycle either way).
    """

    def __init__(
        self,
        clock: Clock,
        gain: float,
        pattern: FixedPattern | None = None,
        offsets: npt.NDArray[np.int64] | None = None,
    ) -> None:
        self._clock = clock
        self._per_cycle = gain * float(clock.period)
        self._offsets = np.zeros(1, np.int64) if offsets is None else offsets
        self._earliest, self._latest = int(self._offsets.min()), int(self._offsets.max())
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
        if box is not None and plane is piece.last and not piece.constant:
            y0, y1, x0, x1 = box
            charge = self._level(piece.first, piece).reshape(plane.shape).copy()
            charge[y0:y1, x0:x1] = self._fixed(plane, box)
            charge = charge.ravel()
        else:
            charge = self._fixed(plane, (0, plane.shape[0], 0, plane.shape[1])).ravel()
        self._levels = [*self._levels[-3:], (plane, charge)]
        return charge

    def _electrons(self, plane: Plane, box: Box) -> npt.NDArray[np.float64]:
        """Electrons a cycle within a box of a steady plane, fixed pattern and dark current in it,
        held at nothing."""
        y0, y1, x0, x1 = box
        light = plane[y0:y1, x0:x1]
        if not (light >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(light.min()):g}")
        electrons = light.astype(np.float64) * self._per_cycle
        if self._pattern is not None:
            gain, dark = (m.reshape(plane.shape)[y0:y1, x0:x1] for m in self._pattern)
            electrons = np.maximum(electrons * gain + dark, 0)  # a leak may be more than the light
        return electrons

    def _fixed(self, plane: Plane, box: Box) -> Charge:
        """The same as charge, held at LARGEST."""
        return to_fixed(self._electrons(plane, box))

    def _course(self, piece: Piece) -> _Course:
        for course in self._courses:
            if course.piece is piece:
                return course
        clock = self._clock
        origin = clock.cycle_at(piece.start - self._earliest)
        if clock.edge(origin) + self._earliest < piece.start:
            origin += 1
        stop = clock.cycle_at(piece.stop - self._latest)
        first = self._level(piece.first, piece)
        charge, slope = first, None
        if not piece.constant:
            plane = piece.first.shape
            y0, y1, x0, x1 = piece.changed or (0, plane[0], 0, plane[1])
            last = self._level(piece.last, piece)
            change = last.reshape(plane)[y0:y1, x0:x1] - first.reshape(plane)[y0:y1, x0:x1]
            cycles = float(clock.position(piece.stop) - clock.position(piece.start))
            begun = float(origin - clock.position(piece.start)) + self._rows(y0, y1) / self._period
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

    @property
    def _period(self) -> float:
        """Picoseconds in a cycle."""
        return float(PS * self._clock.period)

    def _rows(self, first: int, stop: int) -> npt.NDArray[np.int64]:
        """Offsets of rows `first` to `stop` as a column; one for all where all are sampled at
        once."""
        rows = self._offsets if self._offsets.size == 1 else self._offsets[first:stop]
        return rows[:, None]

    def _meeting(self, light: Light, cycle: int) -> Charge:
        """Charge of one cycle in which pieces meet, in some row at least.

        A sum of changes from the level at which the first of them begins: where nothing changes it
        is that level to the last bit, so the boxes that pieces promise may be trusted.
        """
        start, stop = self._clock.edge(cycle), self._clock.edge(cycle + 1)
        met = [
            p
            for p in light.pieces
            if p.start < stop + self._latest and p.stop > start + self._earliest
        ]
        if not met:  # all of the cycle lies before instant 0
            return self._level(light.pieces[0].first, light.pieces[0])
        base = self._level(met[0].first, met[0])
        box = _changing(met)
        if box is None:
            return base
        y0, y1, x0, x1 = box
        within = base.reshape(light.shape)[y0:y1, x0:x1]
        rows = self._rows(y0, y1)
        total: npt.NDArray[np.float64] = np.zeros(within.shape)
        # A flash may be far brighter than a whole cycle's light can be: it is held at nothing
        # before its share of the cycle is taken.
        beyond: npt.NDArray[np.float64] = np.zeros(within.shape)
        for piece in met:
            a = np.maximum(start + rows, piece.start)
            b = np.minimum(stop + rows, piece.stop)
            share = np.maximum(b - a, 0) / (stop - start)
            # Halfway through the piece's part in the cycle; its length may be near 2^62.
            part = ((a - piece.start) / 2 + (b - piece.start) / 2) / (piece.stop - piece.start)
            first, last = (
                self._level(plane, piece).reshape(light.shape)[y0:y1, x0:x1]
                for plane in (piece.first, piece.last)
            )
            total += ((first - within) + (last - first) * part) * share
            more = self._excess(piece.first, first, box)
            beyond += (more + (self._excess(piece.last, last, box) - more) * part) * share
        charge = base.copy()
        sums = charge.reshape(light.shape)[y0:y1, x0:x1]
        sums += np.rint(total).astype(np.int64)
        lit = beyond > 0
        if lit.any():
            held = np.minimum(sums[lit] + np.rint(beyond[lit]), LARGEST * ONE)
            sums[lit] = held.astype(np.int64)
        return charge

    def _excess(self, plane: Plane, charge: Charge, box: Box) -> npt.NDArray[np.float64] | float:
        """What a steady plane brings in a cycle beyond LARGEST, at which its charge is held."""
        if charge.max() < LARGEST * ONE:
            return 0.0
        return np.maximum(self._electrons(plane, box) - LARGEST, 0) * float(ONE)

    def spans(self, light: Light, start: int, cycles: int) -> list[Span]:
        """Spans that fill cycles `start` to `start + cycles` of the clock.

        Raises ValueError when the light does not cover them.
        """
        clock, spans, c, stop = self._clock, [], start, start + cycles
        begin, end = max(clock.edge(start) + self._earliest, 0), clock.edge(stop) + self._latest
        if light.pieces[0].start > begin or light.pieces[-1].stop < end:
            raise ValueError(
                f"light must cover {begin} to {end} ps, not "
                f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
            )
        while c < stop:
            begin, end = clock.edge(c) + self._earliest, clock.edge(c + 1) + self._latest
            piece = next(p for p in light.pieces if p.stop > begin)
            if begin < piece.start or end > piece.stop:
                spans.append(Span(c - start, 1, self._meeting(light, c)))
                c += 1
                continue
            course = self._course(piece)
            until = min(course.stop, stop)
            spans.append(Span(c - start, until - c, course.charge, course.slope, c - course.origin))
            c = until
        return spans


def _changing(pieces: list[Piece]) -> Box | None:
    """The box that holds every change from the start of the first of these pieces on; None where
    there is none."""
    boxes: list[Box] = []
    height, width = pieces[0].first.shape
    for n, piece in enumerate(pieces):
        if n == 0 and piece.constant:
            continue
        boxes.append(piece.changed or (0, height, 0, width))
    if not boxes:
        return None
    y0, y1, x0, x1 = zip(*boxes, strict=True)
    return min(y0), max(y1), min(x0), max(x1)
