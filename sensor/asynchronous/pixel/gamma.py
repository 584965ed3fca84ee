"""Gamma and Poisson laws inside compiled loops: both tails, their inverses, densities.

numba reaches no scipy, and a call back into Python for each report would cost more than the report.
All functions take an integer-valued shape q >= 1 as float64. Accuracy: about 1e-12 relative for
shapes of thousands, 1e-8 at two million, where q log x itself loses digits; tested against scipy.
"""

from __future__ import annotations

import math

from numba import njit

_TINY = 1e-300
_EPS = 1e-15


@njit(cache=True, error_model="numpy", nogil=True)
def xdensity(q, x):  # type: ignore[no-untyped-def]
    """x f(x), f the density of Gamma(q, 1)."""
    if x <= 0.0 or x == math.inf:
        return 0.0
    return math.exp(q * math.log(x) - x - math.lgamma(q))


@njit(cache=True, error_model="numpy", nogil=True)
def tails(q, x):  # type: ignore[no-untyped-def]
    """(P, Q): the regularised lower and upper incomplete gamma functions, each to its own digits.

    Series 6.5.29 below q + 1, the continued fraction 6.5.31 above (Abramowitz and Stegun).
    """
    if x <= 0.0:
        return 0.0, 1.0
    if x == math.inf:
        return 1.0, 0.0
    front = xdensity(q, x)
    if x < q + 1.0:
        term = 1.0 / q
        total, n = term, q
        while term > total * _EPS:
            n += 1.0
            term *= x / n
            total += term
        lower = front * total
        return lower, 1.0 - lower
    b = x + 1.0 - q
    c, d = 1.0 / _TINY, 1.0 / b
    h = d
    for i in range(1, 1_000_000):
        a = -i * (i - q)
        b += 2.0
        d = a * d + b
        if abs(d) < _TINY:
            d = _TINY
        c = b + a / c
        if abs(c) < _TINY:
            c = _TINY
        d = 1.0 / d
        step = d * c
        h *= step
        if abs(step - 1.0) < _EPS:
            break
    upper = front * h
    return 1.0 - upper, upper


@njit(cache=True, error_model="numpy", nogil=True)
def inverse_upper(q, start, goal):  # type: ignore[no-untyped-def]
    """x >= start with Q(q, x) = exp(goal), where Q(q, start) is no less.

    log Q is concave, so Newton's steps overshoot once and then fall to the root from above.
    """
    x = start
    for _ in range(200):
        upper = tails(q, x)[1]
        if upper <= 0.0:
            x = 0.5 * (x + start)
            continue
        step = (math.log(upper) - goal) * upper * x / max(xdensity(q, x), _TINY)
        x = max(x + step, start)
        if abs(step) <= 1e-14 * x:
            break
    return x


@njit(cache=True, error_model="numpy", nogil=True)
def inverse_lower(q, start, goal):  # type: ignore[no-untyped-def]
    """x <= start with P(q, x) = exp(goal), where P(q, start) is no less."""
    x = start
    for _ in range(200):
        lower = tails(q, x)[0]
        if lower <= 0.0:
            x = 0.5 * (x + start)
            continue
        step = (goal - math.log(lower)) * lower * x / max(xdensity(q, x), _TINY)
        after = x + step
        x = min(after, start) if after > 0.0 else 0.5 * x
        if abs(step) <= 1e-14 * x:
            break
    return x


@njit(cache=True, error_model="numpy", nogil=True)
def _pmf(k, mean):  # type: ignore[no-untyped-def]
    if mean <= 0.0:
        return 1.0 if k == 0 else 0.0
    return math.exp(k * math.log(mean) - mean - math.lgamma(k + 1.0))


@njit(cache=True, error_model="numpy", nogil=True)
def poisson_below(mean, q, u):  # type: ignore[no-untyped-def]
    """Quantile u of Poisson(mean), given that it is below q (whole): the electrons of a pixel that
    has not fired. Searched from the middle outwards."""
    if mean <= 0.0:
        return 0
    goal = u * tails(float(q), mean)[1]
    k = min(int(mean), q - 1)
    below, p = tails(k + 1.0, mean)[1], _pmf(k, mean)
    if goal <= below:
        while k > 0 and goal <= below - p:
            below -= p
            p *= k / mean
            k -= 1
        return k
    while k < q - 1 and goal > below:
        k += 1
        p *= mean / k
        below += p
    return k


@njit(cache=True, error_model="numpy", nogil=True)
def poisson_outside(mean, low, high, q, u):  # type: ignore[no-untyped-def]
    """Quantile u of Poisson(mean) given that it is below `low` or above `high`; q or more counts
    as q."""
    left = tails(float(low), mean)[1] if low > 0 else 0.0
    right = tails(high + 1.0, mean)[0]
    goal = u * (left + right)
    if goal < left:
        k = low - 1
        p = _pmf(k, mean)
        while k > 0 and goal > p:
            goal -= p
            p *= k / mean
            k -= 1
        return k
    goal -= left
    k = high + 1
    p = _pmf(k, mean)
    while k < q and goal > p:
        goal -= p
        k += 1
        p *= mean / k
    return min(k, q)
