"""A spike train of one stiff pixel by closed forms: the phases one after another, in seconds."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.circuit.circuit import Circuit
from sensor.circuit.phases import DELAY, INTEGRATE, within

Values = npt.NDArray[np.float64]
_SCALE = 1e12


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
