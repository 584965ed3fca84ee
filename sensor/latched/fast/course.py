"""The course of light over a call: a few planes and weights, from which kernels compute each cycle.

The light of a cycle is base + sum of weight x (plane - base). For a cycle within a piece, the base
is the first plane of the piece, and the weight of its last plane is the position of the middle of
the cycle in the piece. For a cycle in which pieces meet, the weights are the integrals of the
linear pieces over the cycle. Weights depend on the cycle and the row only, so every cycle gets the
same numbers however a run is split. Where the light is constant all planes are equal, and the sum
is the base to the last bit; so pixels outside the changed boxes need no weights.

Most kernels that step from cycle to cycle add a whole number to the light instead of weighing
planes.
They start from an anchor: the first cycle of a piece, or of each 32 cycles of the clock in it.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Box, Light, Piece, Plane
from cosim.spikes.viform import WORD
from sensor.latched.row_timing import PlaneTiming

__all__ = ["MOST_PLANES", "Course", "Segment", "course_of"]

MOST_PLANES: Final = 16
"""Most planes of a segment, including its base, and of a launch of a kernel."""

Weights = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Segment:
    """Cycles of a call that share planes.

    Attributes:
        first: first cycle, within the call.
        cycles: number of cycles.
        base: (H, W) float32, light of weight 0.
        planes: (H, W) float32 each.
        weights: (cycles, rows of the box or 1, planes) float32.
        anchors: (words, rows of the box or 1, 3) float32, weight at the anchor of each 32 cycles of
            the clock; the anchor, in cycles from the start of the call; and the number of cycles
            for which it holds, which may lie outside the call. None for no ramp.
        slope: change of the weight in a cycle.
    """

    first: int
    cycles: int
    base: Plane
    planes: tuple[Plane, ...]
    weights: Weights
    anchors: Weights | None = None
    slope: float = 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """Light of a call.

    Attributes:
        steady: (H, W) light outside the box.
        box: rows and columns in which the light changes, None if it is constant everywhere.
        segments: light inside the box.
        pieces: all pieces of the call, whose planes must be checked.
    """

    steady: Plane
    box: Box | None
    segments: list[Segment]
    pieces: tuple[Piece, ...]


def _box(met: tuple[Piece, ...]) -> Box | None:
    """The box of all changes from the start of the first of these pieces, None if there are
    none."""
    height, width = met[0].first.shape
    boxes = []
    for n, piece in enumerate(met):
        if piece.constant and (n == 0 or piece.first is met[n - 1].last):
            continue
        boxes.append(piece.changed or (0, height, 0, width))
    if not boxes:
        return None
    y0, y1, x0, x1 = zip(*boxes, strict=True)
    return min(y0), max(y1), min(x0), max(x1)


def _within(
    piece: Piece, clock: Clock, cycles: npt.NDArray[np.int64], offsets: npt.NDArray[Any]
) -> npt.NDArray[np.float64]:
    """Position in a piece, 0 to 1, of the middle of each cycle, (cycles, rows). cycles: (cycles, 1)
    or one for each row. offsets: of these middles, ps; for all cycles, or for each."""
    origin = clock.cycle_at(piece.start)
    unit = PS * clock.den  # a cycle is unit / clock.num ps; integers are divided only once
    phase = offsets / (unit / clock.num)
    begun = (origin * unit - piece.start * clock.num) / unit + 0.5 + phase
    length = (piece.stop - piece.start) * clock.num / unit
    return np.asarray((begun + (cycles - origin).astype(np.float64)) / length)


def _anchors(
    piece: Piece, clock: Clock, c: int, until: int, start: int, rows: npt.NDArray[np.int64],
    end: int,
) -> Weights:  # fmt: skip
    """Anchors of cycles c to `until`, which lie within a piece; see `Segment`. They depend on the
    piece, the cycle and the row only. end: cycle after the last that lies within the piece in all
    rows."""
    begins = []
    for offset in rows.tolist():
        first = max(piece.start - offset, 0)
        cycle = clock.cycle_at(first)
        begins.append(cycle + (clock.edge(cycle) < first))
    words = WORD * np.arange(c // WORD, (until - 1) // WORD + 1)[:, None]
    cycles = np.maximum(words, begins)
    anchors = np.empty((*cycles.shape, 3), np.float32)
    anchors[..., 0] = _within(piece, clock, cycles, rows)
    anchors[..., 1] = cycles - start
    anchors[..., 2] = np.minimum(words + WORD, end) - cycles
    return anchors


def _meeting(
    met: list[Piece],
    start: int,
    stop: int,
    low: npt.NDArray[np.int64],
    high: npt.NDArray[np.int64],
    dark: Plane | None,
) -> tuple[tuple[Plane, ...], Weights]:
    """Planes of the pieces that meet between two edges, which rows reach at other instants by `low`
    and `high`, and their weights, (rows, planes). dark: a plane that gathers nothing, if these
    differ."""
    planes: list[Plane] = []
    weights: list[npt.NDArray[np.float64]] = []

    def add(plane: Plane, weight: npt.NDArray[np.float64]) -> None:
        for n, known in enumerate(planes):
            if known is plane:
                weights[n] = weights[n] + weight
                return
        planes.append(plane)
        weights.append(weight)

    for piece in met:
        a = np.maximum(start + low, piece.start)
        b = np.minimum(stop + high, piece.stop)
        share = np.maximum(b - a, 0) / (stop - start)
        if piece.constant:
            add(piece.first, share)
            continue
        # Middle of the piece's part of the cycle. Halves, because its length may be near 2^62.
        part = ((a - piece.start) / 2 + (b - piece.start) / 2) / (piece.stop - piece.start)
        add(piece.first, (1 - part) * share)
        add(piece.last, part * share)
    if dark is not None:
        add(dark, (low - high) / (stop - start))
    others = [n for n, plane in enumerate(planes) if plane is not met[0].first]
    columns = [weights[n] for n in others]
    stacked = np.stack(columns, axis=1) if columns else np.zeros((low.size, 0))
    return tuple(planes[n] for n in others), stacked.astype(np.float32)


def _merged(base: Plane, planes: tuple[Plane, ...], weights: Weights, box: Box, most: Any) -> Plane:
    """The light of a cycle in which more planes meet than a segment can have, as one plane.

    most: upper limit of the light, one or (H, W).
    """
    y0, y1, x0, x1 = box
    limit = np.broadcast_to(np.asarray(most, np.float64), base.shape)[y0:y1, x0:x1]
    first = np.minimum(base[y0:y1, x0:x1], limit)
    change = np.zeros(first.shape)
    for n, plane in enumerate(planes):
        lit = np.clip(plane[y0:y1, x0:x1], 0, limit)
        change += (lit - first) * weights[:, n : n + 1]
    plane = base.copy()
    plane[y0:y1, x0:x1] = np.where(change == 0, base[y0:y1, x0:x1], np.maximum(first + change, 0))
    return plane


def course_of(
    light: Light,
    clock: Clock,
    offsets: npt.NDArray[np.int64],
    start: int,
    cycles: int,
    most: Any = np.inf,
    timing: PlaneTiming | None = None,
    dark: Plane | None = None,
    anchored: bool = False,
) -> Course:
    """The course of light over cycles `start` to `start + cycles` of a clock.

    With noise of the sampling instants, the box is the band of the rows that have it. A cycle that
    is longer by the share s has the light of a cycle, less -s of it: a plane that gathers nothing
    has the weight -s.

    Args:
        light: light on the pixels.
        clock: of the latches.
        offsets: (H,) or (1,) int64, ps from an edge to the sampling instant of a row.
        start: first cycle.
        cycles: number of cycles.
        most: upper limit of the light, one or (H, W).
        timing, dark: noise of the sampling instants, and a plane that gathers nothing; None for
            none.
        anchored: whether segments get anchors.

    Raises:
        ValueError: the light does not cover the cycles.
    """
    slack = 0 if timing is None else timing.most
    earliest, latest = int(offsets.min()) - slack, int(offsets.max()) + slack
    begin, end = clock.edge(start) + earliest, clock.edge(start + cycles) + latest
    if light.pieces[0].start > max(begin, 0) or light.pieces[-1].stop < end:
        raise ValueError(
            f"light must cover {max(begin, 0)} to {end} ps, not "
            f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
        )
    met = tuple(p for p in light.pieces if p.start < end and p.stop > begin) or light.pieces[:1]
    box = _box(met) if timing is None else (timing.first, timing.stop, 0, light.shape[1])
    if box is None:
        return Course(met[0].first, None, [], met)
    rows = offsets if offsets.size == 1 else offsets[box[0] : box[1]]
    if earliest == latest:
        rows = rows[:1]
    # Instants at which the cycles begin and end, (cycles + 1, rows) ps from their edges.
    ends = np.broadcast_to(rows, (cycles + 1, rows.size))
    if timing is not None:
        ends = rows + timing.moves(start, cycles + 1)
    stops = [p.stop for p in met]
    segments: list[Segment] = []
    c, stop = start, start + cycles
    while c < stop:
        begin, end = clock.edge(c) + earliest, clock.edge(c + 1) + latest
        n = bisect_right(stops, begin)
        piece = met[n]
        if begin >= piece.start and end <= piece.stop:
            last = clock.cycle_at(piece.stop - latest)
            until = min(last, stop)
            low, high = ends[c - start : until - start], ends[c - start + 1 : until - start + 1]
            planes: tuple[Plane, ...] = ()
            columns = []
            longer = (high - low) / (PS * clock.den / clock.num)
            if not piece.constant:
                planes = (piece.last,)
                middle = rows if dark is None else (low + high) / 2
                each = np.arange(c, until)[:, None]
                columns.append(_within(piece, clock, each, middle) * (1 + longer))
            if dark is not None:
                planes += (dark,)
                columns.append(-longer)
            weights = np.empty((*low.shape, len(columns)), np.float32)
            for n_th, column in enumerate(columns):
                weights[..., n_th] = column
            ramp, slope = None, 0.0
            if anchored and not piece.constant and dark is None:
                ramp = _anchors(piece, clock, c, until, start, rows, last)
                slope = PS * clock.den / clock.num / (piece.stop - piece.start)
            segments.append(
                Segment(c - start, until - c, piece.first, planes, weights, ramp, slope)
            )  # fmt: skip
            c = until
            continue
        meet = [p for p in met[n:] if p.start < end] or [met[0]]
        planes, weights = _meeting(
            meet, clock.edge(c), clock.edge(c + 1), ends[c - start], ends[c - start + 1], dark
        )
        base = meet[0].first
        if len(planes) >= MOST_PLANES:
            base, planes = _merged(base, planes, weights, box, most), ()
            weights = weights[:, :0]
        segments.append(Segment(c - start, 1, base, planes, weights[None]))
        c += 1
    return Course(met[0].first, box, segments, met)
