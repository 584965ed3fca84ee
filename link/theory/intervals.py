"""Confidence intervals of measured probabilities."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import DEVIATIONS

JUDGED: Final = 100
"""Number of errors from which a point is compared with theory: its relative spread is then a
tenth."""

NORMAL: Final = round(DEVIATIONS, 2)
"""Standard deviations of CONFIDENCE in closed forms, to the digits of docs/link-theory.md."""


def clopper_pearson(
    errors: npt.ArrayLike, trials: npt.ArrayLike, level: float = 0.99
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Exact limits (low, high) of a probability from independent trials, by beta quantiles.

    Clopper and Pearson, Biometrika 26:404 (1934): the true value lies outside in at most 1 - level
    of all cases, half on each side. The lower limit of 0 errors is 0, the upper limit of all errors
    1.
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
    """Confidence level for each of `points` intervals that gives all of them `level`.

    Bonferroni: the risk is divided evenly; the points need not be independent.
    """
    return 1 - (1 - level) / max(points, 1)
