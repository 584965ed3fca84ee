"""What of a circuit the exact tier can carry in its own settings, and what then remains.

Under steady light s (electrons a second) an interval of the circuit lasts the time from what the
reset left, n_r, to the threshold Q, then the comparator's delay t_d, then the reset. Its lumped
form is (threshold + shift) / (s + dark) + dead time:

- leak: dark = -(Q + n_r) / (2 tau), the mean of what leaks. With u = (Q - n_r) / (s tau - n_r) the
  interval is tau times -log(1 - u) instead of u / (1 - u / 2); the difference grows with u.
- comparator: t_d = trip / (gain s) + pole (1 + W0), so the first part is a threshold that much
  higher and the rest, which lies between 0 and one pole, is dead time.
- reset: its own time is dead, and what it leaves (residual, current times resistance) is a
  threshold that much lower.

t_d falls with light and n_r rises, so that on a cell of light the ends bound them: the bound is the
sum of the three remainders over the least lumped interval of the cell, the worst cell. It is for
steady light and for the threshold itself: under a leak a drawn threshold T would have its own dark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim.clock import PS
from sensor.circuit.circuit import Circuit

_CELLS: Final = 400
"""Cells of light a decade."""


@dataclass(frozen=True)
class Lumped:
    """The circuit's first-order effects as parameters of the ideal pixel.

    Attributes:
        dead_time: seconds.
        dark_current: electrons a second, 0 or less.
        shift: electrons, added to the threshold.
        bound: bound of the relative error of the rate that remains, infinite where the leak may
            hold the charge below the threshold.
    """

    dead_time: float
    dark_current: float
    shift: float
    bound: float


def lump(circuit: Circuit, threshold: float, least: float, most: float) -> Lumped:
    """The lumped form of a circuit over light from `least` to `most` electrons a second.

    A capacitance that changes by a share x over the swing changes a leak's current by x / 2 and an
    overshoot in electrons by x at most; where there are both, the linear circuit is lumped, the
    overshoot is corrected and the rest is in the bound.
    """
    from sensor.circuit.phases import (  # numba, which start-up need not wait for
        DELAY,
        RESET,
        within,
    )

    if not 0 < least <= most < math.inf:
        raise ValueError(f"light must be above 0 and finite, not {least:g} to {most:g} e/s")
    if circuit.leak < math.inf and circuit.nonlinearity != 0:
        linear = lump(replace(circuit, nonlinearity=0.0), threshold, least, most)
        share = circuit.nonlinearity * circuit.swing(threshold)
        raised = circuit.trip / circuit.gain * circuit.electrons * share
        leaks = threshold / (2 * circuit.leak * least)
        beyond = abs(share) * (leaks + abs(raised) / threshold)
        return replace(linear, shift=linear.shift + raised, bound=linear.bound + beyond)
    cells = max(math.ceil(_CELLS * math.log10(most / least)), 1)
    light = np.geomspace(least, most, cells + 1)
    packed, tau = circuit.packed(), circuit.leak
    delay, left = np.empty(light.size), np.empty(light.size)
    for i, s in enumerate(light):
        t, charge, _ = within(DELAY, threshold, 0.0, 0.0, threshold, s / PS, 0.0, 1e30, packed)
        delay[i] = t / PS
        _, left[i], _ = within(RESET, charge, 0.0, packed[7], threshold, s / PS, 0.0, 1e30, packed)
    residual = float(left[0] + left[-1]) / 2
    swing = circuit.swing(threshold)
    raised = circuit.trip / circuit.gain * circuit.electrons * (1 + circuit.nonlinearity * swing)
    dark = -(threshold + residual) / (2 * tau)
    if not (
        np.isfinite(delay).all() and left[-1] < threshold and least * tau > threshold
        and least + dark > 0
    ):  # fmt: skip
        return Lumped(circuit.reset_time, dark, raised - residual, math.inf)
    gathering = (threshold - residual + raised) / (light + dark)
    rest = delay - raised / (light + dark)
    ends = gathering[[0, -1]] + delay[[0, -1]] + circuit.reset_time
    pause = float(rest[0] * ends[1] + rest[-1] * ends[0]) / float(ends.sum())
    lumped = gathering + pause + circuit.reset_time
    low, high = slice(None, -1), slice(1, None)
    comparator = np.maximum(
        delay[low] - raised / (light[high] + dark) - pause,
        pause - delay[high] + raised / (light[low] + dark),
    )
    u = (threshold - residual) / (light * tau - residual)
    leak = tau * (-np.log1p(-u) - u / (1 - u / 2)) if tau < math.inf else np.zeros(light.size)
    off = np.maximum(np.abs(left[low] - residual), np.abs(left[high] - residual))
    reset = off / (light[low] - np.maximum(left[high], residual) / tau)
    remains = np.abs(comparator) + leak[low] + reset
    return Lumped(
        circuit.reset_time + pause, dark, raised - residual, float((remains / lumped[high]).max())
    )
