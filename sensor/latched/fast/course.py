"""The course of light over a call as few planes and weights, of which a kernel makes the charge of
every cycle by itself.

The light of a cycle is base + sum of weight x (plane - base): for a cycle within a piece, base is
its first plane and the weight of its last is how far the cycle's middle lies in it; for a cycle in
which pieces meet, each plane counts by the share of the cycle that it has (the integral of linear
pieces). Weights are those of the cycle on the clock and of the row, never of the call: however a
run is split, every cycle gets the same numbers. Where nothing changes all planes are equal and the
sum is the base to the last bit, so what lies outside the changed boxes needs no weights.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Box, Light, Piece, Plane

__all__ = ["MOST_PLANES", "Course", "Segment", "course_of"]

MOST_PLANES: Final = 16
"""Planes of a segment, its base among them, and of a launch of a kernel."""

Weights = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Segment:
    """Cycles `first` to `first + cycles` of a call that share planes. weights: (cycles, rows of the
    box or 1, planes) float32."""

    first: int
    cycles: int
    base: Plane
    planes: tuple[Plane, ...]
    weights: Weights


@dataclass(frozen=True, eq=False)
class Course:
    """Light of a call: `steady` outside the box (all of the plane where that is None), the segments
    within. pieces: all that the call meets, whose levels must be looked at."""

    steady: Plane
    box: Box | None
    segments: list[Segment]
    pieces: tuple[Piece, ...]


def _box(met: tuple[Piece, ...]) -> Box | None:
    """What changes from the start of the first of these pieces on."""
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
    piece: Piece, clock: Clock, c: int, cycles: int, late: npt.NDArray[np.int64]
) -> Weights:
    """How far into its piece the middle of each cycle from c on lies, (cycles, rows)."""
    origin = clock.cycle_at(piece.start)
    unit = PS * clock.den  # of clock.num, so that whole numbers are divided once
    begun = (origin * unit - piece.start * clock.num) / unit + 0.5 + late / float(PS * clock.period)
    length = (piece.stop - piece.start) * clock.num / unit
    elapsed = np.arange(c - origin, c - origin + cycles, dtype=np.float64)
    return ((begun + elapsed[:, None]) / length).astype(np.float32)


def _meeting(
    met: list[Piece], start: int, stop: int, late: npt.NDArray[np.int64]
) -> tuple[tuple[Plane, ...], Weights]:
    """Planes of the pieces that meet between two edges, and their weights, (rows, planes)."""
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
        a, b = np.maximum(start + late, piece.start), np.minimum(stop + late, piece.stop)
        share = np.maximum(b - a, 0) / (stop - start)
        if piece.constant:
            add(piece.first, share)
            continue
        # Halfway through the piece's part in the cycle; its length may be near 2^62.
        part = ((a - piece.start) / 2 + (b - piece.start) / 2) / (piece.stop - piece.start)
        add(piece.first, (1 - part) * share)
        add(piece.last, part * share)
    kept = [n for n, plane in enumerate(planes) if plane is not met[0].first]
    shape = (late.size, len(kept))
    made = np.stack([weights[n] for n in kept], axis=1) if kept else np.zeros(shape)
    return tuple(planes[n] for n in kept), made.astype(np.float32)


def _merged(base: Plane, planes: tuple[Plane, ...], weights: Weights, box: Box, most: Any) -> Plane:
    """A cycle in which more pieces meet than a segment can have, as one plane of its own."""
    y0, y1, x0, x1 = box
    held = np.broadcast_to(np.asarray(most, np.float64), base.shape)[y0:y1, x0:x1]
    first = np.minimum(base[y0:y1, x0:x1], held)
    change = np.zeros(first.shape)
    for n, plane in enumerate(planes):
        change += (np.minimum(plane[y0:y1, x0:x1], held) - first) * weights[:, n : n + 1]
    made = base.copy()
    made[y0:y1, x0:x1] = np.where(change == 0, base[y0:y1, x0:x1], np.maximum(first + change, 0))
    return made


def course_of(
    light: Light,
    clock: Clock,
    offsets: npt.NDArray[np.int64],
    start: int,
    cycles: int,
    most: Any = np.inf,
) -> Course:
    """The course of cycles `start` to `start + cycles`. offsets: (H,) or (1,) int64 ps from an edge
    to the instant at which a row is sampled. most: level at which light is held, one or (H, W).

    Raises ValueError when the light does not cover them.
    """
    earliest, latest = int(offsets.min()), int(offsets.max())
    begin, end = clock.edge(start) + earliest, clock.edge(start + cycles) + latest
    if light.pieces[0].start > max(begin, 0) or light.pieces[-1].stop < end:
        raise ValueError(
            f"light must cover {max(begin, 0)} to {end} ps, not "
            f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
        )
    met = tuple(p for p in light.pieces if p.start < end and p.stop > begin) or light.pieces[:1]
    box = _box(met)
    if box is None:
        return Course(met[0].first, None, [], met)
    late = offsets if offsets.size == 1 else offsets[box[0] : box[1]]
    if earliest == latest:
        late = late[:1]
    stops = [p.stop for p in met]
    segments: list[Segment] = []
    c, stop = start, start + cycles
    while c < stop:
        begin, end = clock.edge(c) + earliest, clock.edge(c + 1) + latest
        n = bisect_right(stops, begin)
        piece = met[n]
        if begin >= piece.start and end <= piece.stop:
            until = min(clock.cycle_at(piece.stop - latest), stop)
            planes: tuple[Plane, ...] = () if piece.constant else (piece.last,)
            weights = _within(piece, clock, c, until - c, late)[:, :, None]
            segments.append(
                Segment(c - start, until - c, piece.first, planes, weights[:, :, : len(planes)])
            )
            c = until
            continue
        meet = [p for p in met[n:] if p.start < end] or [met[0]]
        planes, weights = _meeting(meet, clock.edge(c), clock.edge(c + 1), late)
        base = meet[0].first
        if len(planes) >= MOST_PLANES:
            base, planes = _merged(base, planes, weights, box, most), ()
            weights = weights[:, :0]
        segments.append(Segment(c - start, 1, base, planes, weights[None]))
        c += 1
    return Course(met[0].first, box, segments, met)
