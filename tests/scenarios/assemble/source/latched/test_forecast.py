"""Predicted run times of `viform plan`."""

from __future__ import annotations

import time
from itertools import count

import pytest

from cosim.compute.opencl import Device
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched import study as forecasting
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.assemble.source.latched.study import forecast

BRIGHT = (
    "sensor.chip=spikeone", "sensor.threshold=20000 e", "scene.illuminance=15000 lux",
    "sensor.preset=silicon", "sensor.crosstalk=1e-6", "sensor.lens.white_rate=0.9",
    "scene.at=5 ms", "duration=10 ms", "seed=9",
)  # fmt: skip
"""A step of light near one spike a cycle: some tiles are the reference's. So little cross-talk is
left out."""


def test_everything_is_planned_in_the_same_tier(device: Device) -> None:
    _, scenario = load("step", list(BRIGHT))
    setup = set_up_camera(scenario, None)
    plan = setup.plan(scenario.tolerance)
    everything = forecasting._with_every_effect(setup, plan)
    assert everything is not None and plan.plan.left_out and not everything.plan.left_out
    # With a draw for each spike, at least the tiles that the bank leaves to the reference are.
    assert everything.tier == plan.tier and plan.fine.any() and everything.fine[plan.fine].all()


def test_a_plan_with_every_effect_has_one_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """The least of three blocks after the first; each reading of this clock takes longer than the
    one before, so the first of the three has it."""
    _, scenario = load("star", ["sensor.chip=spikeone", "duration=10 ms", "tolerance=0"])
    setup = set_up_camera(scenario, "numba")
    ticks = count()
    monkeypatch.setattr(time, "perf_counter", lambda: float(next(ticks)) ** 2)
    told = forecast("star", setup)["predicted"]
    assert told["ns_per_pixel_cycle"] == told["everything_ns_per_pixel_cycle"]
    # Six readings a block; those around the camera are the ninth and tenth in all.
    spent = (9**2 - 8**2) * 1e9 / (400 * 250 * 64)
    assert told["ns_per_pixel_cycle"] == pytest.approx(spent)
