"""When light has followed a step: the instant at which it passes half way between its levels.

Light that an emitter gives is a row of pieces of constant drive, within which its level relaxes
exponentially; it follows at once where it has no time constant. Rising light has arrived when it
first reaches half of the step: of packets, that is the first. Falling light has gone at the end of
the last that reached it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["fallen", "half_way", "relaxed", "risen"]

Values = npt.NDArray[np.float64]


def half_way(before: float, after: float) -> float:
    """Level half way between two settled means."""
    return (before + after) / 2


def relaxed(
    edges: Values, drive: Values, rise: float = 0.0, decay: float = 0.0
) -> tuple[Values, Values]:
    """What an emitter, dark before, begins and ends each piece with: two (n, pixels).

    Args:
        edges: (n + 1,) times.
        drive: (n, pixels).
        rise, decay: time constants, in the unit of `edges`, towards a higher and a lower drive; 0
            is there at once.
    """
    if rise == 0 and decay == 0:
        return drive, drive
    first, last = np.empty(drive.shape), np.empty(drive.shape)
    drive = np.ascontiguousarray(drive)  # it is gone through piece by piece
    level = np.zeros(drive.shape[1:])
    length = np.diff(edges)
    # What is left of a difference at the end of each piece: nothing without a time constant.
    left_up, left_down = (
        np.exp(-length / constant) if constant > 0 else np.zeros(len(length))
        for constant in (rise, decay)
    )
    for n, x in enumerate(drive):
        up = x > level
        first[n] = level
        if rise == 0:
            first[n][up] = x[up]
        elif decay == 0:
            first[n][~up] = x[~up]
        level = last[n] = x + (first[n] - x) * np.where(up, left_up[n], left_down[n])
    return first, last


def _passed(first: Values, drive: Values, half: float, constant: float) -> Values:
    """Time from a piece's start until its level passes `half`, which it does within the piece."""
    if constant == 0:
        return np.zeros_like(first)
    return constant * np.log((first - drive) / (half - drive))


def risen(
    edges: Values, drive: Values, half: float, rise: float = 0.0, decay: float = 0.0
) -> Values:
    """(pixels,) first time at which light that was dark reaches `half`; NaN where it never does.

    Args:
        edges: (n + 1,) times.
        drive: (n, pixels).
        rise, decay: see `relaxed`.
    """
    start, end = relaxed(edges, drive, rise, decay)
    hit = (start >= half) | (end >= half)
    n, pixel = np.argmax(hit, axis=0), np.arange(drive.shape[1])
    when = edges[:-1][n].astype(np.float64)
    later = hit.any(axis=0) & (start[n, pixel] < half)
    n, pixel = n[later], pixel[later]
    when[later] += _passed(start[n, pixel], drive[n, pixel], half, rise)
    return np.where(hit.any(axis=0), when, np.nan)


def fallen(
    edges: Values, drive: Values, half: float, rise: float = 0.0, decay: float = 0.0
) -> Values:
    """(pixels,) last time at which light still reaches `half`; the first edge where it never does,
    NaN where it still does at the end of the last piece. Parameters as in `risen`."""
    start, end = relaxed(edges, drive, rise, decay)
    hit = (start >= half) | (end >= half)
    n, pixel = len(drive) - 1 - np.argmax(hit[::-1], axis=0), np.arange(drive.shape[1])
    when = edges[1:][n].astype(np.float64)
    before = hit.any(axis=0) & (end[n, pixel] < half)
    n, pixel = n[before], pixel[before]
    when[before] = edges[:-1][n] + _passed(start[n, pixel], drive[n, pixel], half, decay)
    when = np.where(end[-1] >= half, np.nan, when)
    return np.where(hit.any(axis=0), when, edges[0])
