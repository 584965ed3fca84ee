"""The three phases of a stiff pixel within one linear piece of light, compiled.

integrate (0): the charge rises, and leaks, up to the threshold. delay (1): the comparator's output
answers from the crossing on. reset (2): the switch is closed, and the charge falls toward what
light drives through it. An event is where a phase ends.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from sensor.circuit.closed import crossing_time, output, relaxed, wait_for
from sensor.circuit.relax import relax, swing_of

INTEGRATE, DELAY, RESET = 0, 1, 2


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
