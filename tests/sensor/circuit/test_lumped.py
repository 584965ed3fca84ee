"""A circuit lumped into the exact tier's settings: the bound on what remains holds, tightly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sensor.circuit.circuit import Circuit
from sensor.circuit.lumped import lump
from sensor.circuit.phases import spike_train

CIRCUITS = {
    "reset": Circuit(1e-14, reset_time=3e-8),
    "incomplete reset": Circuit(1e-14, 0.0, math.inf, 1e4, 1e8, 0.0, 3e5, 1e-8),
    "comparator": Circuit(1e-14, 0.0, math.inf, 1e3, 1e9, 0.5, 0.0, 1e-8),
    "leak": Circuit(1e-14, leak=1e-3),
    "all": Circuit(1e-14, 0.0, 2e-3, 1e3, 1e9, 0.5, 1e5, 1e-8),
    "changing C": Circuit(1e-14, 0.2, math.inf, 1e3, 1e9, 0.5, 1e5, 1e-8),
}


def interval(circuit: Circuit, threshold: float, light: float) -> float:
    """Of the full circuit, once it has forgotten how it began."""
    steady = np.full(1, light)
    train = spike_train(circuit, np.array([0.0, 1e3]), steady, steady, np.full(9, threshold))
    return float(train[-1] - train[-2])


@pytest.mark.parametrize("name", CIRCUITS)
def test_the_rate_that_remains_off_is_within_the_bound(name: str) -> None:
    circuit, threshold, least, most = CIRCUITS[name], 5000.0, 3e7, 5e9
    lumped = lump(circuit, threshold, least, most)
    worst = 0.0
    for light in np.geomspace(least, most, 60):
        own = (threshold + lumped.shift) / (light + lumped.dark_current) + lumped.dead_time
        worst = max(worst, abs(interval(circuit, threshold, light) / own - 1))
    assert worst <= lumped.bound * (1 + 1e-6) + 1e-9
    # Three remainders summed and cells of 1/400 decade: not loose by more than this.
    assert lumped.bound <= 3 * worst + 1e-5
    assert lumped.bound < 0.05
    # And it is what lumping is for: far below what leaving all of it out would cost.
    alone = max(abs(interval(circuit, threshold, s) * s / threshold - 1) for s in (least, most))
    assert worst < alone / 3


def test_leak_alone_is_u_squared_over_twelve() -> None:
    lumped = lump(Circuit(1e-14, leak=1.0), 1000.0, 1e5, 1e6)
    assert lumped.bound == pytest.approx((1000 / 1e5) ** 2 / 12, rel=0.03)
    assert lumped.dark_current == -500.0
    assert (lumped.dead_time, lumped.shift) == (0.0, 0.0)


def test_light_that_the_leak_may_hold_has_no_bound() -> None:
    circuit = Circuit(1e-14, leak=1e-3)
    assert lump(circuit, 1000.0, 0.9e6, 1e8).bound == math.inf
    assert lump(circuit, 1000.0, 1.1e6, 1e8).bound < math.inf
    with pytest.raises(ValueError, match="light must be above 0"):
        lump(circuit, 1000.0, 0.0, 1.0)


def test_a_leak_on_a_capacitance_that_changes_is_in_the_bound() -> None:
    # Lumped with the linear circuit's leak: what the other one lasts lies within the bound.
    threshold, least, most = 5000.0, 3e7, 3e9
    circuit = Circuit(1e-14, 0.3, 1e-2, gain=1e3, bandwidth=1e9, trip=0.5)
    lumped = lump(circuit, threshold, least, most)
    linear = lump(replace(circuit, nonlinearity=0.0), threshold, least, most)
    assert linear.bound < lumped.bound < 0.02 and lumped.shift > linear.shift
    for light in np.geomspace(least, most, 7):
        lasts = interval(circuit, threshold, light)
        short = (threshold + lumped.shift) / (light + lumped.dark_current) + lumped.dead_time
        assert abs(short / lasts - 1) <= lumped.bound
