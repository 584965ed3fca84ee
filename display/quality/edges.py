"""Edges of light in space and in time: the blur of a moving edge, the response time to a step.

A camera records an edge, a display shows it, and the eye follows it; the retina image has a step
between two levels. BEW is the distance from 10 to 90 % of this step. BET = BEW / v is independent
of the speed v. EBET = BET / 0.8 is the full width of a linear profile. An ideal hold of T gives a
linear profile of the width v T, so BET = 0.8 T and EBET = T.

MPRT has two conventions. In the measurement standards it is the mean of BET over transitions
between greys; in "1 ms persistence is 1 pixel per 1000 pixels/s" (TestUFO) it is the full width,
the mean of EBET. The exact formula of VESA's ClearMR is not public; this file has a similar ratio,
called CMR-like.

The light of an emitter consists of intervals of constant drive. Within an interval, its level
relaxes exponentially, or follows without delay if it has no time constant. Rising light has
responded when it first reaches half of the step; for packets, with the first packet. Falling light
has responded at the end of the last interval that reaches half of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

LOW: Final = 0.1
HIGH: Final = 0.9
STEP_SHARE: Final = HIGH - LOW
"""Share of the step between the two levels of BEW."""
CMR_FRAME: Final = 1 / 60
"""Hold time whose CMR-like is 100 %, s."""


def blur_edge_width(
    x: npt.ArrayLike, profile: npt.ArrayLike, low: float | None = None, high: float | None = None
) -> float:
    """BEW: the distance from 10 to 90 % of the step in an edge profile, in the unit of x.

    The profile is replaced by the nearest monotone profile in least squares (isotonic regression),
    which does not change a monotone profile. Crossings are interpolated linearly between samples.

    Args:
        x: positions, (n,), increasing.
        profile: levels, (n,); the edge may rise or fall.
        low, high: settled levels at the first and the last x; by default the means of the first and
            the last eighth, which must be outside the blur.

    Raises:
        ValueError: the profile has no step, or does not reach 10 and 90 % of it.
    """
    from scipy.optimize import isotonic_regression  # the import takes 0.5 s

    at, level = np.asarray(x, np.float64), np.asarray(profile, np.float64)
    if at.ndim != 1 or at.shape != level.shape or len(at) < 4 or (np.diff(at) <= 0).any():
        raise ValueError(
            f"a profile must be 4 or more levels at increasing positions, not {level.shape} at "
            f"{at.shape}"
        )
    end = max(len(at) // 8, 1)
    first = float(level[:end].mean()) if low is None else low
    last = float(level[-end:].mean()) if high is None else high
    if not (np.isfinite(level).all() and np.isfinite([first, last]).all() and first != last):
        raise ValueError(f"a profile must be finite and have a step, not {first:g} to {last:g}")
    share = np.asarray(isotonic_regression((level - first) / (last - first)).x)
    return _crossing(at, share, HIGH) - _crossing(at, share, LOW)


def _crossing(at: Values, share: Values, level: float) -> float:
    """The position at which a monotone profile reaches a level. Raises ValueError."""
    k = int(np.searchsorted(share, level, side="left"))
    if k == 0 or k == len(share):
        raise ValueError(
            f"a profile must run through {level:.0%} of its step, not {share[0]:.0%} to "
            f"{share[-1]:.0%}"
        )
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(at[k - 1] + part * (at[k] - at[k - 1]))


def bet(width: float, speed: float) -> float:
    """Blur edge time BEW / v, s, from the width, pixels, and the speed, pixels/s. Raises ValueError
    unless the speed is positive."""
    if not speed > 0:
        raise ValueError(f"speed must be positive, not {speed:g} pixels a second")
    return width / speed


def ebet(blur_edge_time: float) -> float:
    """Extended blur edge time BET / 0.8, s: the full width of a linear profile."""
    return blur_edge_time / STEP_SHARE


def mprt(blur_edge_times: Sequence[float]) -> float:
    """Moving picture response time, s: the mean of BET (10 to 90 %) over transitions between greys.
    An ideal hold of T has 0.8 T. Raises ValueError without a transition."""
    if not len(blur_edge_times):
        raise ValueError("MPRT must be of at least one transition, not of none")
    return float(np.mean(blur_edge_times))


def cmr_like(extended: float) -> float:
    """Ratio of clear to blurred pixels, %: an edge that crosses n pixels in 1/60 s with a blur of m
    pixels has 100 n / m. It is not VESA's ClearMR. `extended`: EBET, s; raises ValueError unless it
    is positive."""
    if not extended > 0:
        raise ValueError(f"EBET must be positive, not {extended:g} s")
    return 100 * CMR_FRAME / extended


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
