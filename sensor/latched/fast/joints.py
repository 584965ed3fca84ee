"""Cycles in which pieces of light meet: the planes of these pieces, and their weights."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Box, Piece, Plane

__all__ = ["Joint", "Weights", "merged", "weighed"]

Weights = npt.NDArray[np.float32]


class Joint(NamedTuple):
    """A cycle of the clock in which pieces meet, in at least one row."""

    cycle: int
    pieces: tuple[Piece, ...]


def weighed(
    joints: list[Joint],
    clock: Clock,
    rows: npt.NDArray[np.int64],
    ends: npt.NDArray[np.int64] | None,
    start: int,
    dark: Plane | None,
) -> list[tuple[tuple[Plane, ...], Weights]]:
    """Planes of the pieces that meet in each cycle, without its first one, and their weights,
    (rows, planes), as in `Segment`. All cycles in which as many pieces meet are computed at once.

    Args:
        joints: the cycles.
        clock, dark: see `course_of`.
        rows: (rows,) ps from an edge to the sampling instant of a row.
        ends: (cycles + 1, rows) the same for the edges of the call; None for `rows` at all.
        start: first cycle of the call.
    """
    found: list[tuple[tuple[Plane, ...], Weights]] = [((), np.zeros((0, 0), np.float32))] * len(
        joints
    )
    for count in {len(joint.pieces) for joint in joints}:
        which = [n for n, joint in enumerate(joints) if len(joint.pieces) == count]
        some = [joints[n] for n in which]
        edges = np.array([[clock.edge(one.cycle), clock.edge(one.cycle + 1)] for one in some])
        low, high = rows[None], rows[None]
        if ends is not None:
            at = np.array([one.cycle - start for one in some])
            low, high = ends[at], ends[at + 1]
        length = (edges[:, 1] - edges[:, 0])[:, None]
        begin, stop = (
            np.array([[getattr(piece, end) for piece in one.pieces] for one in some])[..., None]
            for end in ("start", "stop")
        )
        a = np.maximum((edges[:, :1] + low)[:, None], begin)
        b = np.minimum((edges[:, 1:] + high)[:, None], stop)
        share = np.maximum(b - a, 0) / length[:, None]
        # Middle of the piece's part of the cycle. Halves, because its length may be near 2^62.
        part = ((a - begin) / 2 + (b - begin) / 2) / (stop - begin)
        first, last = (1 - part) * share, part * share
        less = (low - high) / length
        for n, joint, *each in zip(which, some, share, first, last, less, strict=True):
            found[n] = _summed(joint.pieces, each, dark)
    return found


def _summed(
    pieces: tuple[Piece, ...], each: list[Any], dark: Plane | None
) -> tuple[tuple[Plane, ...], Weights]:
    """Planes of a cycle in which pieces meet, and their weights; see `weighed`.

    Args:
        pieces: the pieces.
        each: (pieces, rows) weights of constant pieces, and of the first and the last plane of
            others; and (rows,) that of `dark`.
        dark: a plane that gathers nothing, None for none.
    """
    share, first, last, less = each
    planes, weights = [pieces[0].first], [first[0]]

    def add(plane: Plane, weight: Any) -> None:
        for n, known in enumerate(planes):
            if known is plane:
                weights[n] = weights[n] + weight
                return
        planes.append(plane)
        weights.append(weight)

    for n, piece in enumerate(pieces):
        if piece.constant:
            add(piece.first, share[n])
            continue
        if n:
            add(piece.first, first[n])
        add(piece.last, last[n])
    if dark is not None:
        add(dark, less)
    stacked = np.empty((less.size, len(planes) - (dark is None)), np.float32)
    for n, weight in enumerate(weights[1:]):
        stacked[:, n] = weight
    if dark is not None:
        stacked[:, -1] = 1 / (1 - less)
    return tuple(planes[1:]), stacked


def merged(base: Plane, planes: tuple[Plane, ...], weights: Weights, box: Box, most: Any) -> Plane:
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
