"""One interval in closed form: when light that runs linearly has brought a charge."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

from cosim.compute.philox_compiled import random_words, word_at
from cosim.compute.streams import Stream
from sensor.asynchronous.pixel.gamma import inverse_lower, inverse_upper, poisson_outside, tails
from sensor.asynchronous.pixel.skipping import SKIP, interval_moments
from sensor.latched.pixel.draws import look_up

LEVEL: Final = np.uint64(Stream.READING)
_SHOT: Final = np.uint64(Stream.SHOT_NOISE)
_ONE: Final = 2.0**-40
_NEVER: Final = 1e300
_SCALE: Final = 2.0**-32


@njit(cache=True, error_model="numpy", nogil=True)
def unit(pixel, index, draw, seed, stream):  # type: ignore[no-untyped-def]
    """A number in (0, 1) of 64 random bits."""
    w0, w1, _, _ = random_words(pixel, index, draw, seed, stream)
    return min((float(w0) + (float(w1) + 0.5) * _SCALE) * _SCALE, 1.0 - 2.0**-53)


@njit(cache=True, error_model="numpy", nogil=True)
def goal(table, shot, q, pixel, k, seed, low, high):  # type: ignore[no-untyped-def]
    """Threshold of interval k in electrons, drawn again until it lies within low .. high."""
    if not shot:
        return q
    drawn = look_up(table, word_at(pixel, k, np.uint64(0), seed, _SHOT)) * _ONE
    again = np.uint64(1)
    while not low <= drawn <= high and again < np.uint64(1000):
        word = random_words(pixel, k, again, seed, SKIP)[0]
        drawn = look_up(table, word) * _ONE
        again += np.uint64(1)
    return drawn


@njit(cache=True, error_model="numpy", nogil=True)
def width_law(q, shot, rate, delay, shortest, longest, least, most):  # type: ignore[no-untyped-def]
    """How an interval under a steady rate goes that is unreported while its width lies within
    least .. most: (p of a report, bounds a and b of its threshold, mean, variance and third moment
    of max(threshold, what the shortest width lets in), all in electrons)."""
    held = max(rate * (shortest - delay), 0.0)
    a = 0.0 if least <= shortest else max(rate * (least - delay), 0.0)
    b = rate * (most - delay)
    if longest > 0:
        b = min(b, rate * longest)
    if not shot:
        inside = a <= q <= b
        return (0.0 if inside else 1.0), a, b, max(q, held), 0.0, 0.0
    p = tails(q, a)[0] + tails(q, b)[1]
    if p > 0.5:
        return p, a, b, q, q, 2.0 * q
    mean, variance, third = interval_moments(q, a, b, held)
    return p, a, b, mean, variance, third


@njit(cache=True, error_model="numpy", nogil=True)
def level_law(q, shot, mean, low, high):  # type: ignore[no-untyped-def]
    """Probability that the electrons of a longest width are below `low` or above `high`."""
    if not shot:
        return 0.0 if low <= math.floor(mean) <= high else 1.0
    left = tails(float(low), mean)[1] if low > 0 else 0.0
    return left + tails(high + 1.0, mean)[0]


@njit(cache=True, error_model="numpy", nogil=True)
def rare_goal(q, a, b, p, pixel, k, seed):  # type: ignore[no-untyped-def]
    """A threshold outside a .. b: the interval that is reported at last."""
    lower, upper = tails(q, a)[0], tails(q, b)[1]
    u = unit(pixel, k, np.uint64(2000), seed, SKIP) * (lower + upper)
    if u < lower:
        return inverse_lower(q, a, math.log(max(u, 1e-300)))
    return inverse_upper(q, b, math.log(max(u - lower, 1e-300)))


@njit(cache=True, error_model="numpy", nogil=True)
def rare_reading(q, mean, low, high, pixel, k, seed):  # type: ignore[no-untyped-def]
    """Electrons outside low .. high at the end of a longest width, and the threshold: (below q,
    one never reached) for a reading, (q, threshold) for a spike."""
    u = unit(pixel, k, np.uint64(2000), seed, SKIP)
    electrons = poisson_outside(mean, low, high, int(q), u)
    if electrons < q:
        return electrons, _NEVER
    u = unit(pixel, k, np.uint64(2001), seed, SKIP)
    return electrons, inverse_lower(q, mean, math.log(u) + math.log(tails(q, mean)[0]))
