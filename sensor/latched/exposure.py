"""Exposure: from `Light` to the charge that each latch cycle adds, in Q24.40.

Within a piece, light is linear in time, and the charge changes by the same amount in each cycle; so
two arrays describe a whole piece. A cycle in which pieces meet receives the sum of its parts. If
rows are sampled at different instants, they reach the end of a piece in different cycles, and these
cycles are summed row by row; so is every cycle if a steered clock moves the instants. The arrays
belong to the piece and not to the block, so every cycle gets the same integers however a run is
split.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Box, Light, Piece, Plane
from sensor.device.pattern import FixedPattern
from sensor.latched.pixel.charge import LARGEST, ONE, Charge, Span, Transfer, to_fixed, transferred
from sensor.latched.sampling import PixelTiming, RowMoves

_SHRINK = 1 - 2.0**-50
"""Factor of a slope. Products of int64 and a float64 share lose the last bits of very large
charges; without this factor a ramp that ends in the dark could fall below 0."""
_BAND: Final = 1 << 14
"""Pixels in a band of rows that is computed at once, so that temporary arrays fit in the cache."""
_HELD: Final = 4
"""Planes whose charges are cached."""
_LARGE: Final = 1 << 10
"""Smallest number of pixels for which the compiled sums are used."""


@dataclass(frozen=True, eq=False)
class _Course:
    """Charge in the whole cycles of a piece.

    Attributes:
        piece: the piece of light.
        origin, stop: first cycle, and the cycle after the last.
        charge: (pixels,) Q24.40 in cycle `origin`.
        slope: (pixels,) its change a cycle, None if constant.
    """

    piece: Piece
    origin: int
    stop: int
    charge: Charge
    slope: Charge | None


class Exposure:
    """Integrates light on the pixels of one plane.

    Before instant 0 light has its value at 0. The charge of a cycle is clipped to LARGEST; such a
    pixel fires in every cycle in any case.

    Args:
        clock: clock of the latches.
        gain: photoelectrons a second per unit of light.
        pattern: fixed pattern of these pixels, None if all are nominal.
        offsets: (H,) int64, ps from a clock edge to the sampling instant of each row; None for 0.
        moves: moves of these instants, None for none.
        timing: timing noise of the pixels, None for none.
        transfers: maps of a cycle's charge that the pixels apply, for the charge of that noise.
    """

    def __init__(
        self,
        clock: Clock,
        gain: float,
        pattern: FixedPattern | None = None,
        offsets: npt.NDArray[np.int64] | None = None,
        moves: RowMoves | None = None,
        timing: PixelTiming | None = None,
        transfers: Sequence[Transfer] = (),
    ) -> None:
        self._clock = clock
        self._per_cycle = gain * float(clock.period)
        self._offsets = np.zeros(1, np.int64) if offsets is None else offsets
        self._moves, most = moves, 0 if moves is None else moves.most
        self._timing, self._transfers = timing, tuple(transfers)
        self._earliest = int(self._offsets.min()) - most
        self._latest = int(self._offsets.max()) + most
        self._pattern = (
            None if pattern is None else (pattern.gain, pattern.dark * float(clock.period))
        )
        self._levels: list[tuple[Plane, Charge, bool]] = []
        self._courses: list[_Course] = []

    def _level(self, plane: Plane, piece: Piece) -> Charge:
        """Charge a cycle under a steady plane, (pixels,) Q24.40; cached by plane."""
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
        clipped = bool(charge.max(initial=0) >= LARGEST * ONE)
        self._levels = [*self._levels[1 - _HELD :], (plane, charge, clipped)]
        return charge

    def _electrons(self, plane: Plane, box: Box) -> npt.NDArray[np.float64]:
        """Electrons a cycle within a box of a steady plane, with fixed pattern and dark current,
        not clipped."""
        y0, y1, x0, x1 = box
        light = plane[y0:y1, x0:x1]
        if not (light >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(light.min()):g}")
        electrons = light.astype(np.float64) * self._per_cycle
        if self._pattern is not None:
            gain, dark = (m.reshape(plane.shape)[y0:y1, x0:x1] for m in self._pattern)
            electrons = np.maximum(electrons * gain + dark, 0)  # a leak may exceed the light
        return electrons

    def _fixed(self, plane: Plane, box: Box) -> Charge:
        """`_electrons` in Q24.40, clipped to LARGEST."""
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
        """Charge in the whole cycles of a piece; the last four pieces are cached."""
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
            # astype truncates towards 0, so falling light does not become negative
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
        """Offsets of rows `first` to `stop` as a column; a single one if all rows share it."""
        rows = self._offsets if self._offsets.size == 1 else self._offsets[first:stop]
        return rows[:, None]

    def _ends(
        self, cycle: int, first: int, stop: int
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Offsets of rows `first` to `stop` at the begin and the end of a cycle, columns."""
        rows, moving = self._rows(first, stop), self._moves
        if moving is None:
            return rows, rows
        both = np.zeros((2, stop - first), np.int64)
        y0, y1 = max(first, moving.first), min(stop, moving.stop)
        moves = moving.moves(cycle, 2)[:, y0 - moving.first : y1 - moving.first]
        both[:, y0 - first : y1 - first] = moves
        return rows + both[0][:, None], rows + both[1][:, None]

    def _meeting(self, light: Light, cycle: int) -> Charge:
        """Charge of a cycle in which pieces meet, in at least one row; (pixels,) Q24.40.

        The first level of the first piece, plus a sum of changes. Where the light is constant the
        result is that level to the last bit, as outside the changed boxes.
        """
        start, stop = self._clock.edge(cycle), self._clock.edge(cycle + 1)
        met = [
            p
            for p in light.pieces
            if p.start < stop + self._latest and p.stop > start + self._earliest
        ]
        if not met:  # the cycle lies before instant 0
            return self._level(light.pieces[0].first, light.pieces[0])
        base = self._level(met[0].first, met[0])
        box = _changing(met)
        if self._moves is not None:
            band = (self._moves.first, self._moves.stop, 0, light.shape[1])
            box = band if box is None else _around([box, band])
        if box is None:
            return base
        y0, y1, x0, x1 = box
        begin, end = self._ends(cycle, y0, y1)
        parts = [self._part(piece, start, stop, begin, end) for piece in met]
        longer = (end - begin) / (stop - start)
        levels = None
        if len({id(p) for piece in met for p in (piece.first, piece.last)}) <= _HELD:
            levels = [(self._level(p.first, p), self._level(p.last, p)) for p in met]
        charge = base.copy()
        large = (y1 - y0) * (x1 - x0) >= _LARGE
        if large and levels is not None and not any(clipped for *_, clipped in self._levels):
            from sensor.latched.exposure_compiled import add_parts

            add_parts(
                charge.reshape(light.shape),
                tuple(first.reshape(light.shape) for first, _ in levels),
                tuple(last.reshape(light.shape) for _, last in levels),
                np.stack([share.ravel() for share, _ in parts]),
                np.stack([part.ravel() for _, part in parts]),
                longer.ravel(),
                box,
            )
            return charge
        for top, bottom in _bands(y0, y1, x1 - x0):
            rows = slice(None) if len(begin) == 1 else slice(top - y0, bottom - y0)
            some = [(share[rows], part[rows]) for share, part in parts]
            self._sum(
                charge.reshape(light.shape), met, some, levels, longer[rows], (top, bottom, x0, x1)
            )
        return charge

    @staticmethod
    def _part(
        piece: Piece,
        start: int,
        stop: int,
        begin: npt.NDArray[np.int64],
        end: npt.NDArray[np.int64],
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Share of the time between two edges, moved by `begin` and `end`, that lies in a piece,
        and the position of its middle in the piece, 0 to 1; for each row."""
        a, b = np.maximum(start + begin, piece.start), np.minimum(stop + end, piece.stop)
        share = np.maximum(b - a, 0) / (stop - start)
        # Halves, because the length of a piece may be near 2^62.
        return share, ((a - piece.start) / 2 + (b - piece.start) / 2) / (piece.stop - piece.start)

    def _sum(
        self,
        charge: Charge,
        met: list[Piece],
        parts: list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]],
        levels: list[tuple[Charge, Charge]] | None,
        longer: npt.NDArray[np.float64],
        box: Box,
    ) -> None:
        """Adds the changes of pieces that meet in a cycle, within a box.

        Args:
            charge: (H, W) Q24.40, the first level of the first piece; changed in place.
            met: the pieces.
            parts: share and position of each piece, see `_part`, for the rows of the box.
            levels: charges at the begin and the end of each piece, None to compute them here.
            longer: share by which the cycle of each row of the box is longer.
            box: rows and columns, y0, y1, x0, x1.
        """
        y0, y1, x0, x1 = box
        sums = charge[y0:y1, x0:x1]
        total: npt.NDArray[np.float64] = sums * longer
        # A short flash may be brighter than LARGEST a cycle: its excess counts by its share of the
        # cycle before clipping.
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
            clipped = np.minimum(sums[lit] + np.rint(over[lit]), LARGEST * ONE)
            sums[lit] = clipped.astype(np.int64)

    def _excess(self, plane: Plane, charge: Charge, box: Box) -> npt.NDArray[np.float64] | float:
        """Charge a cycle of a steady plane beyond LARGEST, Q24.40."""
        if charge.max() < LARGEST * ONE:
            return 0.0
        return np.maximum(self._electrons(plane, box) - LARGEST, 0) * float(ONE)

    def spans(self, light: Light, start: int, cycles: int) -> list[Span]:
        """Spans that fill cycles `start` to `start + cycles` of the clock.

        Raises ValueError if the light does not cover them.
        """
        return list(self.each(light, start, cycles))

    def each(self, light: Light, start: int, cycles: int) -> Iterator[Span]:
        """The spans one by one, so that only the charges of a few are in memory."""
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
            if self._moves is not None or begin < piece.start or end > piece.stop:
                spans = [Span(c - start, 1, self._meeting(light, c))]
                c += 1
            else:
                course = self._course(piece)
                until = min(course.stop, stop)
                spans = [Span(c - start, until - c, course.charge, course.slope, c - course.origin)]
                c = until
            yield from spans if self._timing is None else self._timed(spans[0], start, light.shape)

    def _timed(self, span: Span, start: int, shape: tuple[int, int]) -> Iterator[Span]:
        """The cycles of a span, with the charge of the timing noise. start: first cycle of the
        call; shape: of the plane."""
        timing = self._timing
        assert timing is not None
        band = slice(timing.first, timing.stop)
        for n in range(span.cycles):
            charge = span.charge
            if span.slope is not None:
                charge = charge + span.slope * (span.elapsed + n)
            early = np.zeros(shape, np.int64)
            noisy = transferred(self._transfers, charge.reshape(shape)[band])
            early[band] = np.rint(noisy * timing.at(start + span.first + n + 1).astype(np.float64))
            yield Span(span.first + n, 1, charge, advance=early.ravel())


def _bands(first: int, stop: int, width: int) -> Iterator[tuple[int, int]]:
    """Bands of rows from `first` to `stop`, each of about _BAND pixels."""
    step = max(_BAND // max(width, 1), 1)
    for top in range(first, stop, step):
        yield top, min(top + step, stop)


def _changing(pieces: list[Piece]) -> Box | None:
    """The box of all changes from the start of the first of these pieces, None if there are
    none."""
    boxes: list[Box] = []
    height, width = pieces[0].first.shape
    for n, piece in enumerate(pieces):
        if n == 0 and piece.constant:
            continue
        boxes.append(piece.changed or (0, height, 0, width))
    return _around(boxes) if boxes else None


def _around(boxes: list[Box]) -> Box:
    """The box around all of these."""
    y0, y1, x0, x1 = zip(*boxes, strict=True)
    return min(y0), max(y1), min(x0), max(x1)
