"""Whether a pixel carries its residual: the correlation of successive latched intervals."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.interval_law import latched_variance
from sensor.calibrate.parameter import Parameter
from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]
_CLEAR: Final = 0.25
"""Largest standard error of the share that decides between 0 and 1."""


def reset_rule(trains: Trains, good: npt.NDArray[np.bool_], squared: float) -> Parameter:
    """The reset rule from one recording.

    A pixel that carries the charge beyond its threshold fires at instants that the latch rounds,
    and neighbouring intervals share a rounding: their covariance is (q(2m) - 2 q(m)) / 2, with q of
    interval_law.py, about -1/12. A pixel that is reset to zero at the latch begins each interval
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
