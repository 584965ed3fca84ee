"""A stiff pixel in closed forms and series, compiled: its three phases within one linear piece of
light, and a spike train of them one after another.

integrate (0): the charge rises, and leaks, up to the threshold. delay (1): the comparator's output
answers from the crossing on. reset (2): the switch is closed, and the charge falls toward what
light drives through it. An event is where a phase ends.

Charge on a capacitance that changes with its swing, under a leak, has no closed form on a ramp.
(1 + a V) V' = S + S' t - V / tau is stepped by its own Taylor series of order 20, whose
coefficients follow from one another (Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, 2nd ed., section I.8); a step is as long as its last terms allow.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.circuit.circuit import Circuit
from sensor.circuit.closed import crossing_time, output, relaxed, wait_for

Values = npt.NDArray[np.float64]
_ORDER: Final = 20
_NEAR: Final = 1e-12
"""Relative length of a step of Newton's rule that is taken as the last: it doubles the digits."""
INTEGRATE, DELAY, RESET = 0, 1, 2
_SCALE = 1e12


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, error_model="numpy", nogil=True)
def within(phase, charge, volts, wait, goal, rate, slope, left, circuit):  # type: ignore[no-untyped-def]
    """(t, charge, volts): the time t <= left at which the phase ends, and the charge and the
    comparator's output there; t infinite, and the state after `left`, where it does not.

    Args:
        wait: time that the reset has left.
        circuit: circuit as `Circuit.packed`. During the delay the leak and C are those at the
            threshold and their tangents there, which is exact where C is constant.
    """
    leak, a, electrons, gain, pole, trip, ohmic, _ = (
        circuit[0], circuit[1], circuit[2], circuit[3], circuit[4], circuit[5], circuit[6],
        circuit[7],
    )  # fmt: skip
    if phase == INTEGRATE:
        t, charge = _moved(rate, slope, leak, a, electrons, charge, goal, left)
        return t, charge, 0.0
    if phase == DELAY:
        if trip == 0.0:
            return 0.0, charge, 0.0
        swing = swing_of(goal, a, electrons)
        relative = 1.0 + a * swing
        drive = rate - swing * electrons / leak
        slow, volt = leak * relative, gain / (electrons * relative)
        t = wait_for(drive, slope, slow, charge - goal, volt, pole, volts, trip, left)
        end = t if t <= left else left
        volts, _, over = output(drive, slope, slow, charge - goal, volt, pole, volts, end)
        return t, goal + over, volts
    end = wait if wait <= left else left
    if ohmic == 0.0:
        after = 0.0 if wait <= left else charge
    else:
        tau = 1.0 / (1.0 / leak + 1.0 / ohmic)
        _, after = _moved(rate, slope, tau, a, electrons, charge, math.inf, end)
    return (wait if wait <= left else math.inf), after, 0.0


@njit(cache=True, error_model="numpy", nogil=True)
def steady_interval(charge, goal, rate, circuit):  # type: ignore[no-untyped-def]
    """Time from `charge` to the end of the next reset under steady light; infinite where the leak
    holds the charge below goal."""
    far = 1e30
    # A constant would have `within` compiled for it as well.
    phase: Any = np.int64(INTEGRATE)
    total = 0.0
    if charge >= goal:
        phase = DELAY
    volts, wait = 0.0, circuit[7]
    while True:
        t, charge, volts = within(phase, charge, volts, wait, goal, rate, 0.0, far, circuit)
        if not t < far:
            return np.inf
        total += t
        if phase == RESET:
            return total
        if phase == INTEGRATE:
            volts = 0.0
        phase += 1


def spike_train(
    circuit: Circuit, knots: Values, first: Values, last: Values, goals: Values, charge: float = 0.0
) -> Values:
    """Instants of the spikes, at most one for each threshold of `goals` (electrons), seconds.

    Light runs linearly from first[i] to last[i] electrons a second between knots[i] and
    knots[i + 1] (seconds). The pixel begins with `charge` electrons at knots[0].
    """
    out = np.empty(goals.size)
    count = _train(
        knots * _SCALE, first / _SCALE, last / _SCALE, goals, charge, circuit.packed(), out
    )
    return out[:count] / _SCALE


@njit(cache=True, error_model="numpy", nogil=True)
def _train(knots, first, last, goals, charge, circuit, out):  # type: ignore[no-untyped-def]
    # A constant would have `within` compiled for it as well.
    phase: Any = np.int64(INTEGRATE)
    volts, wait, k = 0.0, 0.0, 0
    for i in range(first.size):
        begin, end = knots[i], knots[i + 1]
        slope = (last[i] - first[i]) / (end - begin)
        now, gone = begin, 0.0  # gone: since `begin`, so that short phases keep their digits
        while k < out.size:
            left = (end - begin) - gone
            rate = first[i] + slope * gone
            t, charge, volts = within(
                phase, charge, volts, wait, goals[k], rate, slope, left, circuit
            )
            if t > left:
                wait -= left
                break
            gone += t
            now = begin + gone
            if phase == INTEGRATE:
                phase, volts = DELAY, 0.0
            elif phase == DELAY:
                out[k] = now
                k += 1
                phase, volts, wait = 2, 0.0, circuit[7]
            else:
                phase, wait = INTEGRATE, 0.0
                if k < goals.size and charge >= goals[k]:
                    phase = DELAY
    return k


@njit(cache=True, error_model="numpy", nogil=True)
def _moved(rate, slope, tau, a, electrons, charge, goal, left):  # type: ignore[no-untyped-def]
    """(t, charge) at the crossing, (inf, charge at the end) where there is none."""
    if a == 0.0 or tau == math.inf:
        t = crossing_time(rate, slope, tau, charge, goal, left) if goal < math.inf else math.inf
        if t <= left:
            return t, goal
        return math.inf, relaxed(rate, slope, tau, charge, left)
    t, after = relax(rate, slope, tau, a, electrons, charge, goal, left)
    if goal < math.inf and after >= goal:
        return t, goal
    return math.inf, after


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
