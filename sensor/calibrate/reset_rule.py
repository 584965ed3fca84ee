"""Whether a pixel carries its residual: the correlation of successive latched intervals."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.interval_law import latched_variance
from sensor.calibrate.parameter import Parameter
from sensor.calibrate.trains import Trains

__all__ = ["reset_rule"]

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
    covariance = (latched_variance(2 * mean, 2 * variance) - 2 * latched_variance(mean, variance))/2
    expected, got = number * covariance, products[used]
    total = float(expected.sum())
    share = float(got.sum()) / total if total else 0.0
    error = float(np.sqrt(((got - share * expected) ** 2).sum())) / abs(total) if total else 1.0
    low, high = share - 2 * error, share + 2 * error
    rule = "residual" if share > 0.5 else "hard"
    known = error < _CLEAR and not low < 0.5 < high
    return Parameter(
        "reset", "reset rule", rule if known else None, (None, None), "1", known,
        f"successive intervals have {share:.2f} +- {2 * error:.2f} of the covariance that a "
        "carried residual gives; subtract is residual below one threshold a cycle",
        "" if known else "constant light at 0.2 to 0.6 spikes a cycle",
    )  # fmt: skip
