"""Cycles in which pieces of light meet: the planes of these pieces, and their weights."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Box, Piece, Plane

Weights = npt.NDArray[np.float32]
_Terms = tuple[Any, ...]
"""Number of pieces, and the terms of `_terms_of`."""
_WHOLE, _FIRST, _LAST = range(3)
"""Weights of a piece: that of a constant one, and those of the first and last plane of others."""


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
    (rows, planes), as in `Segment`. All cycles in which the same planes meet in the same way are
    computed at once.

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
    alike: dict[_Terms, list[int]] = {}
    planes = []
    for n, joint in enumerate(joints):
        some, terms = _terms_of(joint.pieces)
        planes.append(some if dark is None else (*some, dark))
        alike.setdefault(terms, []).append(n)
    for terms, which in alike.items():
        some_weights = _summed([joints[n] for n in which], terms, clock, rows, ends, start, dark)
        for n, weights in zip(which, some_weights, strict=True):
            found[n] = planes[n][1:], weights
    return found


def _terms_of(pieces: tuple[Piece, ...]) -> tuple[tuple[Plane, ...], _Terms]:
    """Different planes of the pieces that meet in a cycle, and the terms of their weights: for each
    (number of the plane, of the piece, and which of its weights)."""
    planes, terms = [pieces[0].first], []

    def add(plane: Plane, piece: int, which: int) -> None:
        slot = next((n for n, known in enumerate(planes) if known is plane), len(planes))
        if slot == len(planes):
            planes.append(plane)
        terms.append((slot, piece, which))

    for n, piece in enumerate(pieces):
        if piece.first is piece.last:
            add(piece.first, n, _WHOLE)
            continue
        if n:
            add(piece.first, n, _FIRST)
        add(piece.last, n, _LAST)
    return tuple(planes), (len(pieces), *terms)


def _summed(
    joints: list[Joint], terms: _Terms, clock: Clock, rows: npt.NDArray[np.int64],
    ends: npt.NDArray[np.int64] | None, start: int, dark: Plane | None,
) -> Weights:  # fmt: skip
    """Weights of cycles that have the same terms, (cycles, rows, planes); see `weighed`."""
    edges = np.array([[clock.edge(one.cycle), clock.edge(one.cycle + 1)] for one in joints])
    low, high = rows[None], rows[None]
    if ends is not None:
        at = np.array([one.cycle - start for one in joints])
        low, high = ends[at], ends[at + 1]
    length = (edges[:, 1] - edges[:, 0])[:, None]
    begin, stop = (
        np.array([[getattr(piece, end) for piece in one.pieces] for one in joints])[..., None]
        for end in ("start", "stop")
    )
    a = np.maximum((edges[:, :1] + low)[:, None], begin)
    b = np.minimum((edges[:, 1:] + high)[:, None], stop)
    share = np.maximum(b - a, 0) / length[:, None]
    # Middle of the piece's part of the cycle. Halves, because its length may be near 2^62.
    part = ((a - begin) / 2 + (b - begin) / 2) / (stop - begin)
    each = {_WHOLE: share, _FIRST: (1 - part) * share, _LAST: part * share}
    less = (low - high) / length
    others = max((slot for slot, *_ in terms[1:]), default=0)
    weights = np.zeros((len(joints), less.shape[1], others + 2 * (dark is not None)), np.float32)
    for slot in range(1, others + 1):
        mine = [each[which][:, n] for other, n, which in terms[1:] if other == slot]
        weights[..., slot - 1] = sum(mine[1:], mine[0])
    if dark is not None:
        weights[..., others], weights[..., others + 1] = less, 1 / (1 - less)
    return weights


def merged(base: Plane, planes: tuple[Plane, ...], weights: Weights, box: Box, most: Any) -> Plane:
    """The light of a cycle in which more planes meet than a segment can have, as one plane.

    most: upper limit of the light, one or (H, W).
    """
    base, planes = np.asarray(base), tuple(map(np.asarray, planes))
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
