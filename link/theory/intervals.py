"""Intervals of measured probabilities, and when theory agrees with them."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["JUDGED", "clopper_pearson", "pointwise_level"]

JUDGED: Final = 100
"""Errors from which a point is judged: its relative spread is then a tenth."""


def clopper_pearson(
    errors: npt.ArrayLike, trials: npt.ArrayLike, level: float = 0.99
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Exact limits (low, high) of a probability from independent trials, by beta quantiles.

    Clopper and Pearson, Biometrika 26:404 (1934): the true value lies outside in at most
    1 - level of all cases, half on each side. 0 errors begin at 0, all errors end at 1.
    """
    from scipy.special import betainccinv, betaincinv

    k, n = (np.asarray(a, np.float64) for a in (errors, trials))
    if (k < 0).any() or (k > n).any() or (n <= 0).any() or not 0 < level < 1:
        raise ValueError("errors must be 0 to trials, trials above 0, level between 0 and 1")
    tail = (1 - level) / 2
    inner, outer = np.maximum(k, 1e-300), np.maximum(n - k, 1e-300)
    low = np.where(k > 0, betaincinv(inner, n - k + 1, tail), 0.0)
    high = np.where(k < n, betainccinv(k + 1, outer, tail), 1.0)
    return low, high


def pointwise_level(level: float, points: int) -> float:
    """The level that each of `points` intervals needs for all of them to hold at `level`: the
    misses are shared out evenly (Bonferroni), which needs no independence of the points."""
    return 1 - (1 - level) / max(points, 1)
