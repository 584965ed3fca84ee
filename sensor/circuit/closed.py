"""Closed forms of the stiff pixel's phases under light that runs linearly, compiled.

Time t and time constants share a unit; rate: electrons per unit of time; slope: its change per
unit. All are sums of terms that cannot cancel, by the functions phi_k(z) = integral over u from 0
to 1 of exp(-(1 - u) z) u^(k-1) / (k-1)! (Hochbruck and Ostermann, Acta Numerica 19:209, 2010, with
-z).
"""

from __future__ import annotations

import math
from typing import Final

from numba import njit

_NEAR: Final = 1e-12
"""Relative length of a step of Newton's rule that is taken as the last: it doubles the digits."""


@njit(cache=True, error_model="numpy", nogil=True)
def phi(k, z):  # type: ignore[no-untyped-def]
    """phi_k(z), k from 0 to 3: phi_0 = exp(-z), phi_(k+1) = (1/k! - phi_k) / z; z >= 0."""
    if k == 0:
        return math.exp(-z)
    if z < 1.0:
        term = 1.0 if k == 1 else 0.5 if k == 2 else 1.0 / 6.0
        total, n = term, float(k)
        while abs(term) > 1e-18:
            n += 1.0
            term *= -z / n
            total += term
        return total
    one = -math.expm1(-z) / z
    if k == 1:
        return one
    two = (1.0 - one) / z
    return two if k == 2 else (0.5 - two) / z


@njit(cache=True, error_model="numpy", nogil=True)
def relaxed(rate, slope, tau, charge, t):  # type: ignore[no-untyped-def]
    """Charge after t of n' = rate + slope t - n / tau; tau may be infinite."""
    z = t / tau
    return charge * math.exp(-z) + t * (rate * phi(1, z) + slope * t * phi(2, z))


@njit(cache=True, error_model="numpy", nogil=True)
def crossing_time(rate, slope, tau, charge, goal, left):  # type: ignore[no-untyped-def]
    """First t <= left at which n' = rate + slope t - n / tau has brought charge to goal >= charge;
    infinite where it has not by then.

    Under steady light -tau log1p(-(goal - charge) / (rate tau - charge)), infinite where the leak
    holds the charge below goal. On a ramp n' changes its sign once at most, so the charge has one
    extremum at most: the crossing is bracketed, a dip that only grazes it included.
    """
    need = goal - charge
    if need <= 0.0:
        return 0.0
    if slope == 0.0:
        if tau == math.inf:
            t = need / rate if rate > 0.0 else math.inf
        else:
            reach = rate * tau - charge
            t = -tau * math.log1p(-need / reach) if need < reach else math.inf
        return t if t <= left else math.inf
    low, high = 0.0, left
    start = rate - charge / tau
    if start <= 0.0 and slope <= 0.0:
        return math.inf
    if slope < 0.0:  # rising, then falling
        top = -start / slope if tau == math.inf else tau * math.log1p(-start / (slope * tau))
        high = min(high, top)
    elif start < 0.0 and tau < math.inf:  # falling, then rising
        low = min(tau * math.log1p(-start / (slope * tau)), left)
    if relaxed(rate, slope, tau, charge, high) < goal:
        return math.inf
    t = 0.5 * (low + high)
    for _ in range(200):
        miss = relaxed(rate, slope, tau, charge, t) - goal
        if miss < 0.0:
            low = t
        else:
            high = t
        speed = start * math.exp(-t / tau) + slope * t * phi(1, t / tau)
        after = t - miss / speed if speed > 0.0 else 0.5 * (low + high)
        if abs(after - t) <= _NEAR * t:
            return after
        if not low < after < high:
            after = 0.5 * (low + high)
            if not low < after < high:
                return high
        t = after
    return t


@njit(cache=True, error_model="numpy", nogil=True)
def comparator_delay(c):  # type: ignore[no-untyped-def]
    """x > 0 of x - 1 + exp(-x) = c >= 0: x = 1 + c + W0(-exp(-(1 + c))), by Newton's rule.

    Below 1e-4 by the series in s = sqrt(2c), s + s^2/6 + s^3/36 + s^4/270 + s^5/4320 - s^6/17010
    (Stirling's, of y - log(1 + y) = c with y = exp(-x) - 1), where the equation itself cancels.
    """
    s = math.sqrt(2.0 * c)
    series = 1.0 / 36.0 + s * (1.0 / 270.0 + s * (1.0 / 4320.0 - s / 17010.0))
    series = s * (1.0 + s * (1.0 / 6.0 + s * series))
    if c < 1e-4:
        return series
    x = series if c < 2.0 else 1.0 + c
    for _ in range(50):
        small = -math.expm1(-x)
        step = (x - small - c) / small
        x -= step
        if abs(step) <= _NEAR * x:
            break
    return x


@njit(cache=True, error_model="numpy", nogil=True)
def _two(k, a, b, t):  # type: ignore[no-untyped-def]
    """The integral over two poles, t^k times the divided difference of exp at -at, -bt and k - 1
    zeros; k from 1 to 3, 0 <= b <= a / 4."""
    x, y = a * t, b * t
    if k == 1:
        return t * math.exp(-y) * phi(1, x - y)
    if x >= 1.0:
        return t ** (k - 1) * (phi(k - 1, y) - phi(k - 1, x)) / (a - b)
    term = 0.5 if k == 2 else 1.0 / 6.0
    total, n, power, mixed = term, float(k), 1.0, 1.0
    for _ in range(30):
        n += 1.0
        term /= -n
        power *= y
        mixed = x * mixed + power
        total += term * mixed
        if abs(term * mixed) < 1e-18:
            break
    return t**k * total


@njit(cache=True, error_model="numpy", nogil=True)
def output(drive, slope, leak, over, gain, pole, y, t):  # type: ignore[no-untyped-def]
    """(output, its rate of change, overdrive) of the comparator after t.

    over' = drive + slope t - over / leak electrons beyond the threshold; y' = (gain over - y) /
    pole volts, gain in volts an electron.
    """
    a, b = 1.0 / pole, 1.0 / leak
    beyond = relaxed(drive, slope, leak, over, t)
    volts = y * math.exp(-a * t) + gain * a * (
        over * _two(1, a, b, t) + drive * _two(2, a, b, t) + slope * _two(3, a, b, t)
    )
    return volts, (gain * beyond - volts) * a, beyond


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, error_model="numpy", nogil=True)
def wait_for(drive, slope, leak, over, gain, pole, y, trip, left):  # type: ignore[no-untyped-def]
    """First t <= left at which the comparator's output has risen to trip, or infinite.

    The output may fall again under light that drops or leaks away; one such turn is looked for
    within `left`.
    """
    if y >= trip:
        return 0.0
    if slope == 0.0 and leak == math.inf and over == 0.0 and y == 0.0:
        if drive <= 0.0:
            return math.inf
        t = pole * comparator_delay(trip / (gain * drive * pole))
        return t if t <= left else math.inf
    # Bracket: from where it would be under steady light on, doubled up to `left`.
    low, high, t = 0.0, left, 0.0
    span = pole
    if over == 0.0 and y == 0.0 and drive > 0.0:
        span = 1.001 * pole * comparator_delay(trip / (gain * drive * pole))
    while True:
        t = min(span, left)
        volts, speed, _ = output(drive, slope, leak, over, gain, pole, y, t)
        if volts >= trip:
            high = t
            break
        if speed < 0.0:
            a, b = low, t
            for _ in range(100):
                t = 0.5 * (a + b)
                volts, speed, _ = output(drive, slope, leak, over, gain, pole, y, t)
                if volts >= trip or b - a <= 1e-15 * b:
                    break
                if speed < 0.0:
                    b = t
                else:
                    a = t
            if volts >= trip:
                high = t
                break
            t = min(span, left)
        low = t
        if t >= left:
            return math.inf
        span *= 2.0
    t = high
    for _ in range(200):
        volts, speed, _ = output(drive, slope, leak, over, gain, pole, y, t)
        if volts < trip:
            low = t
        else:
            high = t
        after = t - (volts - trip) / speed if speed > 0.0 else 0.5 * (low + high)
        if abs(after - t) <= _NEAR * t:
            return after
        if not low < after < high:
            after = 0.5 * (low + high)
            if not low < after < high:
                return high
        t = after
    return t
