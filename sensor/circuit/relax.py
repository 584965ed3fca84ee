"""Charge on a capacitance that changes with its swing, under a leak: no closed form on a ramp.

(1 + a V) V' = S + S' t - V / tau is stepped by its own Taylor series of order 20, whose
coefficients follow from one another (Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, 2nd ed., section I.8); a step is as long as its last terms allow.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

_ORDER: Final = 20

_NEAR: Final = 1e-12
"""Relative length of a step of Newton's rule that is taken as the last: it doubles the digits."""


@njit(cache=True, error_model="numpy", nogil=True)
def swing_of(charge, a, electrons):  # type: ignore[no-untyped-def]
    """Volts of a charge: the root of electrons (V + a V^2 / 2) = charge."""
    linear = charge / electrons
    return 2.0 * linear / (1.0 + math.sqrt(max(1.0 + 2.0 * a * linear, 0.0)))


@njit(cache=True, error_model="numpy", nogil=True)
def charge_of(swing, a, electrons):  # type: ignore[no-untyped-def]
    """Electrons of a swing."""
    return electrons * swing * (1.0 + 0.5 * a * swing)


@njit(cache=True, error_model="numpy", nogil=True)
def _value(series, t):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(_ORDER, -1, -1):
        total = total * t + series[k]
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def _speed(series, t):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(_ORDER, 0, -1):
        total = total * t + k * series[k]
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def _series(series, v, a, s, ramp, tau):  # type: ignore[no-untyped-def]
    """Fills the Taylor coefficients of V at V = v and gives the length of a step."""
    series[0] = v
    for k in range(_ORDER):
        total = (s if k == 0 else ramp if k == 1 else 0.0) - series[k] / tau
        for j in range(1, k + 1):
            total -= a * series[j] * (k + 1 - j) * series[k + 1 - j]
        series[k + 1] = total / ((k + 1) * (1.0 + a * v))
    scale = max(abs(v), abs(series[1]) * tau * 1e-3, 1e-300)
    step = math.inf
    for k in (_ORDER - 1, _ORDER):
        if series[k] != 0.0:
            step = min(step, (1e-17 * scale / abs(series[k])) ** (1.0 / k))
    return step


@njit(cache=True, error_model="numpy", nogil=True)
def relax(rate, slope, tau, a, electrons, charge, goal, left):  # type: ignore[no-untyped-def]
    """(t, charge then): the first t <= left at which charge reaches goal, or (left, charge) where
    it does not; goal infinite to look for none."""
    if charge >= goal:
        return 0.0, charge
    series = np.empty(_ORDER + 1)
    v, t = swing_of(charge, a, electrons), 0.0
    top = swing_of(goal, a, electrons) if goal < math.inf else math.inf
    s, ramp = rate / electrons, slope / electrons
    while t < left:
        if ramp == 0.0 and abs(s * tau - v) <= 2e-16 * abs(v) + 1e-300:
            return left, charge_of(v, a, electrons)
        step = min(_series(series, v, a, s, ramp, tau), left - t)
        end = step
        after = _value(series, step)
        if top < math.inf:
            found = after >= top
            if not found and _speed(series, 0.0) > 0.0 and _speed(series, step) < 0.0:
                low, high = 0.0, step  # the one turn that V can make
                for _ in range(60):
                    end = 0.5 * (low + high)
                    if _speed(series, end) > 0.0:
                        low = end
                    else:
                        high = end
                found = _value(series, end) >= top
            if found:
                low, high = 0.0, end
                x = end
                for _ in range(200):
                    miss, speed = _value(series, x) - top, _speed(series, x)
                    if miss < 0.0:
                        low = x
                    else:
                        high = x
                    near = x - miss / speed if speed > 0.0 else 0.5 * (low + high)
                    if abs(near - x) <= _NEAR * x:
                        x = near
                        break
                    if not low < near < high:
                        near = 0.5 * (low + high)
                        if not low < near < high:
                            break
                    x = near
                return t + x, goal
        v, t, s = after, t + step, s + ramp * step
    return left, charge_of(v, a, electrons)
