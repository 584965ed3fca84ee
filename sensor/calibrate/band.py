"""Timing noise of a band of rows.

A sum of intervals has the variance 2 s^2 beyond that of noise that accumulates, as
far as rounding to cycles lets it show (`sample_variance`). The sample variances of the pixels of
each row are fitted with s b(row), b the raised cosine of sensor/latched/sampling.py, by least
squares over size, centre and width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.histograms import sample_variance
from sensor.calibrate.known import Parameter, rooted
from sensor.calibrate.trains import LEAST_ROWS, SIGNIFICANT, Trains
from sensor.latched.sampling import RowTiming

Values = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.bool_]
_WIDTHS: Final = tuple(float(w) for w in np.geomspace(3, 1000, 26))
"""Widths of a band that are tried, rows."""
_CENTRES: Final = 101
_JITTERS: Final = (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13, 0.17, 0.22, 0.3)
"""Sizes of timing noise between which misfits are interpolated, cycles."""
_PARTS: Final = 8
_TOGETHER: Final = (1, 2, 3, 4, 5, 7)
"""Intervals of the sums that show timing noise."""


@dataclass(frozen=True)
class Band:
    """Timing noise of a band of rows.

    Attributes:
        jitter: RMS at its middle, cycles.
        centre: its middle, as a share of the height.
        rows: full width at half maximum.
        error: standard error of jitter^2.
    """

    jitter: float
    centre: float
    rows: float
    error: float


def measure_band(
    trains: Trains, good: Pixels, squared: float, dead: float, timing: bool
) -> Band | None:
    """The band of rows whose pixels have timing noise; None if there is none.

    Args:
        trains: recording of constant light.
        good: (n,) pixels.
        squared: sigma^2 of an interval.
        dead: dead time, cycles.
        timing: whether all rows together have timing noise; without, a band must explain more than
            one noise of all rows does.
    """
    height = trains.shape[0]
    misfit = _row_misfits(trains, good, squared, dead, _JITTERS)
    rows = np.flatnonzero(np.isfinite(misfit[:, 0]))
    if rows.size < LEAST_ROWS:
        return None
    misfit, none = misfit[rows], float(misfit[rows, 0].sum())
    even = _between(misfit, _JITTERS, np.ones(rows.size), np.array(_JITTERS)).sum(axis=1)
    none = none if timing else min(none, float(even.min()))
    best, size, band = none, 0.0, (0.5, _WIDTHS[0])
    for centre in np.linspace(0, 1, _CENTRES):
        for wide in _WIDTHS:
            profile = RowTiming(1.0, 0.0, float(centre), wide).profile(rows, height)
            course = _between(misfit, _JITTERS, profile, np.array(_JITTERS)).sum(axis=1)
            if course.min() < best:
                best, size = float(course.min()), _JITTERS[int(course.argmin())]
                band = float(centre), wide
    if none - best < (SIGNIFICANT + 1) ** 2 * len(_TOGETHER):  # of many bands, the best
        return None
    tried = size * np.linspace(0.6, 1.5, 91)
    known = (0.0, *(size * np.linspace(0.1, 1.5, 15)))
    profile = RowTiming(1.0, 0.0, *band).profile(rows, height)
    finer = _row_misfits(trains, good, squared, dead, known)[rows]
    each = _between(finer, known, profile, tried)

    def least(course: Values) -> float:
        """Where a parabola through the values near the least one has its own."""
        near = slice(max(int(course.argmin()) - 15, 0), int(course.argmin()) + 16)
        bend, slope, _ = np.polyfit(tried[near], course[near], 2)
        if bend <= 0:
            return float(tried[course.argmin()])
        return float(np.clip(-slope / 2 / bend, tried[0], tried[-1]))

    # The jackknife over rows, of which every eighth is left out.
    without = [least(np.delete(each, slice(n, None, _PARTS), axis=1).sum(axis=1))
               for n in range(_PARTS)]  # fmt: skip
    error = float(np.std(without)) * (_PARTS - 1) ** 0.5
    found = Band(least(each.sum(axis=1)), *band, 2 * size * error)
    return found if found.jitter**2 > SIGNIFICANT * found.error else None


def _between(misfit: Values, sizes: Sequence[float], profile: Values, tried: Values) -> Values:
    """Misfits of rows with the timing noise that each of the `tried` sizes at the middle of a band
    gives them, (tried, rows), from those of `sizes`, (rows, sizes)."""
    known, s = np.array(sizes), tried[:, None] * profile
    at = np.clip(np.searchsorted(known, s, "right") - 1, 0, known.size - 2)
    part, row = (s - known[at]) / np.diff(known)[at], np.arange(profile.size)
    return np.asarray(misfit[row, at] + (misfit[row, at + 1] - misfit[row, at]) * part)


def _row_misfits(
    trains: Trains, good: Pixels, squared: float, dead: float, sizes: Sequence[float]
) -> Values:
    """Squared distance of the sample variances of sums of intervals from those that each of the
    sizes of timing noise lets expect, over its mean without it, (rows, sizes); nan for rows without
    pixels.

    A sum of k intervals of a length near a whole number of cycles shows timing noise, and one of
    a length between does not, as it is rounded either way. So several k are taken together.
    """
    height, width = trains.shape
    known = trains.spikes[good & (trains.spikes > 0)]
    fewest = int(np.quantile(known, 0.02)) - 1 if known.size else 0
    out, number = np.zeros((height, len(sizes))), np.zeros(height)
    for k in _TOGETHER:
        blocks = fewest // k
        if blocks < 3:
            continue
        sums = trains.sums(k, blocks, good)
        mean = trains.intervals[sums.used]
        noise = squared * (mean - dead) ** 2
        row = np.flatnonzero(sums.used) // width
        number += np.bincount(row, minlength=height)
        scale = 0.0
        for n, size in enumerate(sizes):
            off = sums.variance[sums.used] - sample_variance(mean, noise, k, blocks, 2 * size**2)
            scale = scale or float((off**2).mean())
            out[:, n] += np.bincount(row, off**2, height) / scale
    out[number == 0] = np.nan
    return out


def band_pixels(band: Band, trains: Trains) -> Pixels:
    """The pixels of the rows of a band, (n,)."""
    height, width = trains.shape
    profile = RowTiming(band.jitter, 0.0, band.centre, band.rows).profile(np.arange(height), height)
    return np.repeat(profile > 0, width)


def band_parameters(band: Band | None, mixed: bool) -> list[Parameter]:
    """Timing noise by row band. mixed: whether sums have all phases, without which it has none."""
    title = "timing noise in the middle of a band of rows"
    if band is None:
        return [Parameter(
            "row_jitter", title, None, (None, None), "cycles", False,
            "no band of rows has more timing noise than the others" if mixed else
            "as timing noise of the latch", "a longer recording of still light",
        )]  # fmt: skip
    value, ci = rooted(band.jitter**2, band.error)
    why = "variance of sums of intervals beyond the noise that accumulates, by row"
    free = (None, None)
    return [
        Parameter("row_jitter", title, value, ci, "cycles", True, why),
        Parameter(
            "row_band", "middle of that band, share of the height", band.centre, free, "1", True,
            why,
        ),
        Parameter(
            "row_band_width", "width of that band at half maximum, rows", band.rows, free, "1",
            True, why,
        ),
    ]  # fmt: skip
