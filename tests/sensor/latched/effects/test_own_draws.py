"""Noise from the bank against a draw for each spike: bound, cost, and size of the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.plan.effects import Summary
from cosim.plan.planner import make_plan
from sensor.device.chips import CHIPS
from sensor.latched.effects.effect import BANK_FROM, bank_cost, noise_cost
from sensor.latched.effects.own_draws import OWN_DRAWS, with_own_draws
from sensor.latched.fast.units import BANK, NOISE
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import tier_pixels
from sensor.latched.writes import Write

SETTING = CameraSetting(CHIPS["spikeone"], Clock(40_000), 1000.0, 1)
SPREAD = 1000.0**-0.5


def scene(rate: float, window: int = 41) -> Summary:
    return Summary(rate * 1000, rate * 1000, 1000.0, window, 2000, 0.01, SPREAD)


def plan(rate: float, tolerance: float = 1e-3, setting: CameraSetting = SETTING) -> dict[str, bool]:
    """Which effects of noise a tile of this rate keeps."""
    effects = with_own_draws(setting.acting_effects, setting)
    kept = make_plan(effects, scene(rate), tolerance).kept
    return {name: bool(kept[name].all()) for name in ("shot noise", OWN_DRAWS)}


def test_the_bank_is_chosen_where_it_costs_less() -> None:
    assert plan(0.3) == {"shot noise": True, OWN_DRAWS: False}
    assert plan(1.2) == {"shot noise": True, OWN_DRAWS: False}
    assert plan(BANK_FROM / 2) == {"shot noise": True, OWN_DRAWS: True}
    for rate in (1e-4, 0.01, 0.6):
        assert bank_cost(scene(rate)) <= noise_cost(scene(rate))


def test_tolerance_0_keeps_a_draw_for_each_spike() -> None:
    assert plan(0.3, 0.0) == {"shot noise": True, OWN_DRAWS: True}
    assert plan(0.3, 1e-5) == {"shot noise": True, OWN_DRAWS: True}


def test_without_a_bank_nothing_changes() -> None:
    wide = replace(SETTING, threshold=20.0)
    quiet = replace(SETTING, effects=())
    written = replace(SETTING, writes=(Write(100, 800.0),))
    for setting in (wide, quiet, written):
        effects = setting.acting_effects
        assert with_own_draws(effects, setting) == effects


@pytest.mark.parametrize("rate", [0.05, 0.3])
def test_the_noise_of_a_window_has_the_same_size(device: Device, rate: float) -> None:
    shape, window, many = (64, 400), 64, 40
    plane = np.full(shape, rate / SETTING.rate(1.0), np.float32)
    light = Light((Piece(0, PS, plane, plane),))
    numbers, sizes = np.arange(plane.size, dtype=np.uint32), []
    for flag in (NOISE, NOISE | BANK):
        flags = np.full((64, 25), flag, np.uint8)
        pixels = tier_pixels("fast", SETTING, shape, numbers, np.arange(64), device, flags)
        found, before = [], pixels.fraction()
        for n in range(many):
            words = pixels.expose(light, n * window, window)
            after = pixels.fraction()
            found.append(np.bitwise_count(words).sum(axis=0, dtype=float) + after - before)
            before = after
        assert np.mean(found) == pytest.approx(rate * window, rel=1e-3)
        sizes.append(np.std(found))
    error = 3 / np.sqrt(2 * many * plane.size)
    assert abs(sizes[1] / sizes[0] - 1) < 5e-3 + error
