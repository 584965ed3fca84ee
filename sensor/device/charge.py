"""Charge of a pixel and time under light that changes linearly, as compiled functions."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy", nogil=True)
def crossing(rate, slope, need):  # type: ignore[no-untyped-def]
    """Picoseconds x in which rate x + slope x^2 / 2 = need, infinite where it never does.

    The root in the form that adds: no cancellation for rising light, and for falling light only
    what the tangent's own condition loses. rate: electrons a picosecond, >= 0.
    """
    if need <= 0.0:
        return 0.0
    if slope == 0.0:
        return need / rate if rate > 0.0 else math.inf
    inside = rate * rate + 2.0 * slope * need
    if inside < 0.0:
        return math.inf
    below = rate + math.sqrt(inside)
    return 2.0 * need / below if below > 0.0 else math.inf


@njit(cache=True, error_model="numpy", nogil=True)
def exposure(rate, slope, x):  # type: ignore[no-untyped-def]
    """Charge of x picoseconds; light is never below zero, so neither is this."""
    return max((rate + 0.5 * slope * x) * x, 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def later(instant, part, span):  # type: ignore[no-untyped-def]
    """instant + part + span as whole picoseconds and a fraction in [0, 1)."""
    total = part + span
    whole = math.floor(total)
    return instant + np.int64(whole), total - whole
