"""The step: bars that jump at an instant."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Block, Clock
from scenarios.scenes.charts.patches import BARS, StepSource
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE

CLOCK = Clock(40_000)
LUX = 500.0


def step(at: float, *, before: float = 0.2, after: float = 0.8, cycles: int = 200) -> StepSource:
    return StepSource((4, 32), LUX, before, after, at, CLOCK.edge(cycles))


def test_the_step_shows_eight_bars_of_equal_steps_before_and_after():
    source = step(1e-3)
    bars = np.repeat(np.arange(1, BARS + 1) / BARS, 4)
    for ps, level in ((0, 0.2), (10**9 - 1, 0.2), (10**9, 0.8), (10**15, 0.8)):
        np.testing.assert_allclose(source.truth(ps), np.tile(level * bars, (4, 1)), rtol=1e-6)
        light = source.step(None, Block(0, 1)).at(ps)
        np.testing.assert_allclose(light, LUX * source.truth(ps), rtol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.4, 0.999])
def test_a_jump_inside_a_cycle_lands_as_the_exact_mixed_charge(share):
    source, gain = step((50 + share) * 25e-6), 1e6
    spans = Exposure(CLOCK, gain).spans(source.step(None, Block(40, 20)), 40, 20)
    before, after = (
        source.step(None, Block(40, 20)).at(CLOCK.edge(c)).astype(np.float64).ravel() * gain * 25e-6
        for c in (40, 59)
    )
    charge = np.concatenate([np.tile(span.charge, (span.cycles, 1)) for span in spans])
    assert all(span.slope is None for span in spans)
    expected = np.array([before] * 10 + [share * before + (1 - share) * after] + [after] * 9)
    assert charge.shape == expected.shape
    # Rounding to 2^-40 of two levels and of their sum, each by half a unit.
    np.testing.assert_allclose(charge / ONE, expected, atol=1.5 / ONE, rtol=1e-15)


def test_a_jump_at_the_very_start_leaves_only_the_light_after_it():
    source = step(0.0)
    assert len(source.step(None, Block(0, 1)).pieces) == 1
    np.testing.assert_allclose(source.truth(0)[:, -1], 0.8, rtol=1e-6)


def test_a_jump_behind_the_end_of_the_run_is_said():
    assert step(4.999e-3).degraded == []
    assert step(5e-3).degraded == ["the run ends before the step of the light: lengthen duration"]
