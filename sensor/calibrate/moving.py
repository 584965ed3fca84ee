"""What one recording of a moving or unknown scene tells: limits, and the reset rule.

This file also covers whether a pixel carries its residual: the correlation of successive latched
intervals.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.histograms import latched_variance
from sensor.calibrate.known import Parameter, proportion
from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]

_CLEAR: Final = 0.25
"""Largest standard error of the share that decides between 0 and 1."""


def reset_rule(trains: Trains, good: npt.NDArray[np.bool_], squared: float) -> Parameter:
    """The reset rule from one recording.

    A pixel that carries the charge beyond its threshold fires at instants that the latch rounds,
    and neighbouring intervals share a rounding: their covariance is (q(2m) - 2 q(m)) / 2, with q of
    histograms.py, about -1/12. A pixel that is reset to zero at the latch begins each interval
    anew: no covariance. The measured share of the expected sum is about 1 or 0. `subtract` differs
    from `residual` only above one threshold a cycle.

    Args:
        trains: a recording in which intervals are long enough to have a rounding.
        good: (n,) bool, the pixels.
        squared: relative variance of an interval.
    """
    used = good & (trains.spikes > 3)
    _, products = trains.successive(used)
    mean, number = trains.intervals[used], trains.spikes[used] - 2
    variance = np.maximum(squared, 0.0) * mean**2
    two, one = latched_variance(2 * mean, 2 * variance), latched_variance(mean, variance)
    expected = number * (two - 2 * one) / 2
    return _decided(
        products[used], expected, "successive intervals", "constant light at 0.2 to 0.6"
    )


def moving_reset_rule(trains: Trains) -> Parameter:
    """The reset rule under light that changes slowly against an interval.

    Differences d_i of successive intervals do not see a slow change. With a carried residual d_i is
    u_(i+2) - 2 u_(i+1) + u_i and noise, with rounding errors u of variance 1/12, so that d_i and
    d_(i+2) share one: their covariance is 1/12 on average over means. Without a residual it is 0.

    Args:
        trains: the recording; pixels with mean intervals from 2 to 8 cycles are used.
    """
    mean = trains.intervals
    used = (mean > 2) & (mean < 8) & (trains.spikes > 8)
    products, number = trains.differences(used)
    return _decided(
        products[used], number[used] / 12, "every other difference of intervals",
        "slower motion, at 0.2 to 0.5",
    )  # fmt: skip


def _decided(got: Values, expected: Values, what: str, remedy: str) -> Parameter:
    """The parameter, from what pixels show and what a carried residual lets expect, (n,)."""
    total = float(expected.sum())
    share = float(got.sum()) / total if total else 0.0
    error = float(np.sqrt(((got - share * expected) ** 2).sum())) / abs(total) if total else 1.0
    low, high = share - 2 * error, share + 2 * error
    rule = "residual" if share > 0.5 else "hard"
    known = error < _CLEAR and not low < 0.5 < high
    return Parameter(
        "reset", "reset rule", rule if known else None, (None, None), "1", known,
        f"the covariance of {what} is {share:.2f} +- {2 * error:.2f} of that by a carried "
        "residual, 0 without one; below one threshold a cycle subtract is residual",
        "" if known else f"{remedy} spikes a cycle",
    )  # fmt: skip


_FLATS: Final = "recordings of constant uniform light: --flat A.dat --flat B.dat"
_WHY: Final = "the light of each pixel is unknown and changes"


def moving_parameters(trains: Trains) -> list[Parameter]:
    """Parameters from one recording whose light is not constant.

    Motion only adds to the variance of sums of intervals. So the noise that the differences of
    successive sums show, less the rounding of the latch, is an upper limit of the temporal noise,
    and its inverse square a lower limit of the threshold in electrons. Let a and b be successive
    sums of k intervals with a common end: var(b - a) = 2 k sigma^2 m^2 + 1/2 (rounding errors u0 -
    2 u1 + u2 of variance 1/12 each), plus the change of the light squared.
    """
    total = trains.spikes.size
    out = []
    noise = _most_noise(trains)
    out.append(Parameter(
        "interval_noise", "temporal noise of an interval, relative", None, (0.0, noise), "1", False,
        f"{_WHY}; motion adds to the variance of intervals, so it is a limit from above",
        "one recording of constant light",
    ))  # fmt: skip
    out.append(Parameter(
        "threshold", "threshold", None, (noise**-2 if noise else None, None), "e", False,
        "1/Q is at most the noise squared", "constant light and a light meter",
    ))  # fmt: skip
    out.append(moving_reset_rule(trains))
    for name, title in (
        ("gain_spread", "spread of the pixels' response to light, in all"), ("prnu", "PRNU"),
        ("threshold_fpn", "spread of the threshold"),
    ):  # fmt: skip
        out.append(Parameter(
            name, title, None, (None, None), "1", False,
            "a pixel of higher gain and a brighter place of the scene look alike", _FLATS,
        ))  # fmt: skip
    dimmest = _dimmest(trains)
    out.append(Parameter(
        "dark_current", "dark current over the threshold", None,
        (0.0, dimmest * trains.clock.hz), "1/s", False,
        "no pixel fires less than its dark current: the mean over pixels of the rate in their "
        "longest interval is a limit from above", "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    out.append(Parameter(
        "dsnu", "DSNU, relative to the dark current", None, (None, None), "1", False, _WHY,
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    shortest = _shortest(trains)
    out.append(Parameter(
        "dead_time", "dead time", None,
        (0.0, None if shortest is None else shortest / trains.clock.hz), "s", False,
        "the dead time is not longer than an interval; the least mean of a pixel, with the "
        f"rounding of the latch, is {'?' if shortest is None else format(shortest, '.3g')} cycles",
        "two flats of different light: --flat A.dat --flat B.dat",
    ))  # fmt: skip
    silent, stuck = int((trains.spikes == 0).sum()), int((trains.spikes >= trains.cycles).sum())
    out.append(Parameter(
        "dead_pixels", "dead pixels, share", None, (0.0, proportion(silent, total)[1][1]), "1",
        False, f"{silent} of {total} pixels never fire; the scene may be dark there", _FLATS,
    ))  # fmt: skip
    out.append(Parameter(
        "hot_pixels", "hot pixels, share", None, (None, None), "1", False,
        "cannot be known in light: a hot pixel and a bright place look alike",
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    out.append(Parameter(
        "stuck_pixels", "stuck pixels, share", None, (0.0, proportion(stuck, total)[1][1]), "1",
        False, f"{stuck} of {total} pixels fire in every cycle; the scene may be bright there",
        "a recording with the lens capped: --dark D.dat",
    ))  # fmt: skip
    return out


def _most_noise(trains: Trains) -> float:
    """Upper limit of the relative noise of an interval: the least over k of what sums of k
    intervals show, with two standard errors."""
    limits = [1.0]
    spikes = trains.spikes[trains.spikes > 0]
    fewest = int(np.quantile(spikes, 0.1)) - 1
    for k in (1, 2, 4, 8, 16, 32):
        if fewest < 2 * k:
            break
        sums = trains.sums(k, 2, np.ones(trains.spikes.size, bool))
        used = sums.used & np.isfinite(trains.intervals)
        mean = trains.intervals[used]
        # The sample variance of two sums is half the squared difference: its rounding is 1/4.
        off, weight = sums.variance[used] - 0.25, k * mean**2
        value = float(off.sum() / weight.sum())
        error = float(np.sqrt(((off - value * weight) ** 2).sum())) / float(weight.sum())
        limits.append(float(np.sqrt(max(value + 2 * error, 1e-12))))
    return min(limits)


def _shortest(trains: Trains) -> float | None:
    """Least mean interval of a pixel, cycles, with the rounding of its first and last spike by up
    to one cycle; None without two spikes in a pixel."""
    used = trains.spikes > 1
    if not used.any():
        return None
    return float((trains.intervals[used] + 1 / (trains.spikes[used] - 1)).min())


def _dimmest(trains: Trains) -> float:
    """Mean over pixels of the least rate, spikes a cycle: the inverse of the longest interval, or
    of the recording for a pixel with fewer than two spikes."""
    total = 0.0
    for words in np.array_split(trains.words, max(len(trains.words) // 4096, 1)):
        bits = np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=1, bitorder="little")[
            :, : trains.cycles
        ]
        for row in bits:
            at = np.flatnonzero(row)
            total += 1 / (np.diff(at).max() if len(at) > 1 else trains.cycles)
    return total / len(trains.words)
