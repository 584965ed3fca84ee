"""Logarithms of the Gamma law's tails, however far out: a likelihood that is cut off has no peak.

scipy's tails underflow 37 standard deviations away, and the first look at a likelihood lies
thousands away. There the continued fractions converge within some tens of terms: 8.9.2 of the NIST
Digital Library of Mathematical Functions above, 8.9.1 below.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

_DEEP = 1e-250
"""Tail below which the continued fraction takes over."""
_TERMS = 1000
_EPS = 1e-14

Reals = npt.NDArray[np.float64]
Term = Callable[[int], tuple[Reals | float, Reals | float]]


def _fraction(first: Reals, term: Term) -> Reals:
    """first + a1/(b1 + a2/(b2 + ...)), term(i) = (a_i, b_i); modified Lentz."""
    value = first.copy()
    c, d = first.copy(), np.zeros(first.shape)
    for i in range(1, _TERMS):
        a, b = term(i)
        d = 1.0 / (b + a * d)
        c = b + a / c
        step = c * d
        value *= step
        if (np.abs(step - 1.0) < _EPS).all():
            break
    return value


def _far_upper(q: float, x: Reals) -> Reals:
    whole = _fraction(x + 1.0 - q, lambda i: (i * (q - i), x + (2 * i + 1) - q))
    return q * np.log(x) - x - math.lgamma(q) - np.log(whole)


def _far_lower(q: float, x: Reals) -> Reals:
    def term(i: int) -> tuple[Reals, float]:
        return (-(q + i // 2) * x if i % 2 else (i // 2) * x), q + i

    # The fraction of 8.9.1 times q.
    whole = _fraction(np.full(x.shape, q), term)
    return q * np.log(x) - x - math.lgamma(q) - np.log(whole)


def _log_tail(q: float, x: Reals, near: Reals, far: Callable[[float, Reals], Reals]) -> Reals:
    deep = (near < _DEEP) & (x > 0)
    result = np.full(x.shape, -np.inf)
    np.log(near, out=result, where=~deep & (near > 0))
    if deep.any():
        result[deep] = far(q, x[deep])
    return result


def log_upper(q: float, x: Reals) -> Reals:
    """log P(Gamma(q) > x) = log P(Poisson(x) < q), x >= 0 finite, any shape."""
    from scipy.special import gammaincc

    return _log_tail(q, x, gammaincc(q, x), _far_upper)


def log_lower(q: float, x: Reals) -> Reals:
    """log P(Gamma(q) <= x) = log P(Poisson(x) >= q); minus infinity at 0."""
    from scipy.special import gammainc

    return _log_tail(q, x, gammainc(q, x), _far_lower)


def _less(large: Reals, small: Reals) -> Reals:
    """log(exp(large) - exp(small)). Equal to the last digit counts as that digit."""
    return large + np.log(np.maximum(-np.expm1(np.minimum(small - large, 0.0)), 1e-16))


def log_between(q: float, a: Reals, b: Reals) -> Reals:
    """log P(a < Gamma(q) <= b), 0 <= a < b: the difference of the smaller tails."""
    result = np.empty(a.shape)
    up = a > q
    result[up] = _less(log_upper(q, a[up]), log_upper(q, b[up]))
    down = ~up
    result[down] = _less(log_lower(q, b[down]), log_lower(q, a[down]))
    return result


def log_counts(mean: Reals, least: int, most: int) -> Reals:
    """log P(least <= Poisson(mean) <= most), mean > 0."""
    if least == 0:
        return log_upper(most + 1.0, mean)
    result = np.empty(mean.shape)
    up = mean < least
    result[up] = _less(log_lower(float(least), mean[up]), log_lower(most + 1.0, mean[up]))
    down = ~up
    result[down] = _less(log_upper(most + 1.0, mean[down]), log_upper(float(least), mean[down]))
    return result
