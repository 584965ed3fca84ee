"""The response time of light to a step: the instant at which it crosses half of the step.

The light of an emitter consists of intervals of constant drive. Within an interval, its level
relaxes exponentially, or follows without delay if it has no time constant. Rising light has
responded when it first reaches half of the step; for packets, with the first packet. Falling light
has responded at the end of the last interval that reaches half of the step.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]


def half_way(before: float, after: float) -> float:
    """The mean of two settled levels."""
    return (before + after) / 2


def relaxed(
    edges: Values, drive: Values, rise: float = 0.0, decay: float = 0.0
) -> tuple[Values, Values]:
    """Levels of an emitter, dark before the first interval, at the start and the end of each
    interval: two arrays (n, pixels).

    Args:
        edges: times, (n + 1,).
        drive: drive in each interval, (n, pixels).
        rise, decay: time constants towards a higher and a lower drive, in the unit of `edges`; 0
            for none.
    """
    if rise == 0 and decay == 0:
        return drive, drive
    first, last = np.empty(drive.shape), np.empty(drive.shape)
    drive = np.ascontiguousarray(drive)  # the loop reads it row by row
    level = np.zeros(drive.shape[1:])
    length = np.diff(edges)
    # Remaining share of a difference at the end of each interval: 0 without a time constant.
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
    """Time from the start of an interval until its level crosses `half`, within the interval."""
    if constant == 0:
        return np.zeros_like(first)
    return constant * np.log((first - drive) / (half - drive))


def risen(
    edges: Values, drive: Values, half: float, rise: float = 0.0, decay: float = 0.0
) -> Values:
    """The first time at which light, dark before, reaches `half`, (pixels,); NaN if it does not.

    Args:
        edges, drive, rise, decay: see `relaxed`.
        half: level of the crossing.
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
    """The last time at which light reaches `half`, (pixels,); the first edge if it never does, NaN
    if it still does at the end of the last interval. The arguments are those of `risen`."""
    start, end = relaxed(edges, drive, rise, decay)
    hit = (start >= half) | (end >= half)
    n, pixel = len(drive) - 1 - np.argmax(hit[::-1], axis=0), np.arange(drive.shape[1])
    when = edges[1:][n].astype(np.float64)
    before = hit.any(axis=0) & (end[n, pixel] < half)
    n, pixel = n[before], pixel[before]
    when[before] = edges[:-1][n] + _passed(start[n, pixel], drive[n, pixel], half, decay)
    when = np.where(end[-1] >= half, np.nan, when)
    return np.where(hit.any(axis=0), when, edges[0])
