"""From `Light` to the charge that each latch cycle adds, in Q24.40.

Within a piece of light that runs linearly from level a to level b the charge of a cycle changes by
the same amount each cycle, so a whole piece is two arrays. A cycle in which pieces meet gets the
exact sum of its parts. Rows that are sampled at different instants meet the end of a piece in
different cycles; those cycles are summed row by row. The arrays belong to the piece, not to the
block that is being run: however a run is split, every cycle gets the same integers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Box, Light, Piece, Plane
from sensor.device.pattern import FixedPattern
from sensor.latched.pixel.fixed_point import LARGEST, ONE, Charge, to_fixed
from sensor.latched.pixel.span import Span

__all__ = ["Exposure"]

# Products of int64 with a float64 share lose the last bits of very large charges; shrinking the
# slope by this much keeps a ramp that ends in the dark from passing below zero.
_SHRINK = 1 - 2.0**-50
_BAND: Final = 1 << 14
"""Pixels of the rows that are worked on at a time: what lies between their light and their charge
stays in a core's cache."""
_HELD: Final = 4
"""Planes whose charges are kept."""
_LARGE: Final = 1 << 16
"""Pixels from which on sums are worth compiling."""


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
        self._levels: list[tuple[Plane, Charge, bool]] = []
        self._courses: list[_Course] = []

    def _level(self, plane: Plane, piece: Piece) -> Charge:
        """Charge a cycle at a steady `plane`, each plane computed once."""
        for known, charge, _ in self._levels:
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
        held = bool(charge.max(initial=0) >= LARGEST * ONE)
        self._levels = [*self._levels[1 - _HELD :], (plane, charge, held)]
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
        y0, y1, x0, x1 = box
        charge = np.empty((y1 - y0, x1 - x0), np.int64)
        if charge.size >= _LARGE and plane.dtype == np.float32:
            from sensor.latched.exposure_compiled import fix_level

            gain, dark = (np.zeros(1),) * 2 if self._pattern is None else self._pattern
            shape = plane.shape if self._pattern is not None else (1, 1)
            if not fix_level(
                charge, plane, box, self._per_cycle, gain.reshape(shape), dark.reshape(shape),
                self._pattern is not None,
            ):  # fmt: skip
                raise ValueError(f"light must be 0 or more, not {float(plane.min()):g}")
            return charge
        for top, end in _bands(y0, y1, x1 - x0):
            charge[top - y0 : end - y0] = to_fixed(self._electrons(plane, (top, end, x0, x1)))
        return charge

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
        parts = [self._part(piece, start, stop, self._rows(y0, y1)) for piece in met]
        levels = None
        if len({id(p) for piece in met for p in (piece.first, piece.last)}) <= _HELD:
            levels = [(self._level(p.first, p), self._level(p.last, p)) for p in met]
        charge = base.copy()
        large = (y1 - y0) * (x1 - x0) >= _LARGE
        if large and levels is not None and not any(held for *_, held in self._levels):
            from sensor.latched.exposure_compiled import add_parts

            add_parts(
                charge.reshape(light.shape),
                tuple(first.reshape(light.shape) for first, _ in levels),
                tuple(last.reshape(light.shape) for _, last in levels),
                np.stack([share.ravel() for share, _ in parts]),
                np.stack([part.ravel() for _, part in parts]),
                box,
            )
            return charge
        for top, end in _bands(y0, y1, x1 - x0):
            rows = slice(None) if self._offsets.size == 1 else slice(top - y0, end - y0)
            some = [(share[rows], part[rows]) for share, part in parts]
            self._sum(charge.reshape(light.shape), met, some, levels, (top, end, x0, x1))
        return charge

    @staticmethod
    def _part(
        piece: Piece, start: int, stop: int, rows: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The share that a piece has of the time between two edges, and how far into the piece the
        middle of that share lies, of each row."""
        a, b = np.maximum(start + rows, piece.start), np.minimum(stop + rows, piece.stop)
        share = np.maximum(b - a, 0) / (stop - start)
        # Its length may be near 2^62.
        return share, ((a - piece.start) / 2 + (b - piece.start) / 2) / (piece.stop - piece.start)

    def _sum(
        self,
        charge: Charge,
        met: list[Piece],
        parts: list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]],
        levels: list[tuple[Charge, Charge]] | None,
        box: Box,
    ) -> None:
        """Adds to `charge` (H, W), which holds the first level, the changes of the pieces within a
        box. parts: of its rows. levels: of the pieces, made here unless given."""
        y0, y1, x0, x1 = box
        sums = charge[y0:y1, x0:x1]
        total: npt.NDArray[np.float64] | float = 0.0
        # A flash may be far brighter than a whole cycle's light can be: it is held at nothing
        # before its share of the cycle is taken.
        beyond: npt.NDArray[np.float64] | float = 0.0
        for n, (piece, (share, part)) in enumerate(zip(met, parts, strict=True)):
            if not share.any():
                continue
            if levels is None:
                first = self._fixed(piece.first, box)
                last = first if piece.constant else self._fixed(piece.last, box)
            else:
                first, last = (c.reshape(charge.shape)[y0:y1, x0:x1] for c in levels[n])
            more = self._excess(piece.first, first, box)
            if piece.constant:
                if n > 0:
                    total = total + (first - sums) * share
                beyond = beyond + more * share
                continue
            total = total + ((first - sums) + (last - first) * part) * share
            beyond = beyond + (more + (self._excess(piece.last, last, box) - more) * part) * share
        sums += np.rint(total).astype(np.int64)
        lit = np.broadcast_to(beyond > 0, sums.shape)
        if lit.any():
            over = np.broadcast_to(beyond, sums.shape)
            held = np.minimum(sums[lit] + np.rint(over[lit]), LARGEST * ONE)
            sums[lit] = held.astype(np.int64)

    def _excess(self, plane: Plane, charge: Charge, box: Box) -> npt.NDArray[np.float64] | float:
        """What a steady plane brings in a cycle beyond LARGEST, at which its charge is held."""
        if charge.max() < LARGEST * ONE:
            return 0.0
        return np.maximum(self._electrons(plane, box) - LARGEST, 0) * float(ONE)

    def spans(self, light: Light, start: int, cycles: int) -> list[Span]:
        """Spans that fill cycles `start` to `start + cycles` of the clock.

        Raises ValueError when the light does not cover them.
        """
        return list(self.each(light, start, cycles))

    def each(self, light: Light, start: int, cycles: int) -> Iterator[Span]:
        """The same one by one, so that the charges of few are held at a time."""
        clock, c, stop = self._clock, start, start + cycles
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
                yield Span(c - start, 1, self._meeting(light, c))
                c += 1
                continue
            course = self._course(piece)
            until = min(course.stop, stop)
            yield Span(c - start, until - c, course.charge, course.slope, c - course.origin)
            c = until


def _bands(first: int, stop: int, width: int) -> Iterator[tuple[int, int]]:
    """Rows first to stop a few at a time."""
    step = max(_BAND // max(width, 1), 1)
    for top in range(first, stop, step):
        yield top, min(top + step, stop)


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
