"""What is seen of a scene, and what is planned for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosim import Block
from cosim.compute.opencl import Device
from cosim.light.survey import Sketched, survey
from cosim.plan.error import accepted_error
from cosim.plan.planner import SHARE
from cosim.plan.tiles import TILE, TileGrid
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.plan import RunPlan, plan_run
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import SpikeCamera
from sensor.latched.arithmetic import fast_error
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fast.units import BANK
from sensor.latched.planning import FAST_PART

SHAPE, CYCLES = (96, 160), 200
SCENES = ("step", "star", "wave", "film")


def made(name: str, *assignments: str):
    _, scenario = load(name, list(assignments))
    setting = set_up_camera(scenario, "numba").setting
    return scenario.scene.source(SceneGrid(SHAPE, setting.clock, CYCLES, True)), setting.clock


@pytest.mark.parametrize("name", SCENES)
def test_the_interval_holds_all_light_that_is_filmed(name):
    sets = ["scene.at=2 ms"] if name == "step" else []
    if name == "star":
        sets = ["scene.rotation=40 Hz"]
    source, clock = made(name, *sets)
    seen = survey(source, clock, CYCLES)
    filmed, _ = made(name, *sets)
    least, most = np.full(SHAPE, np.inf), np.zeros(SHAPE)
    start = 0
    while start < CYCLES:
        for piece in filmed.step(None, Block(start, min(64, CYCLES - start))).pieces:
            for plane in (piece.first, piece.last):
                least, most = np.minimum(least, plane), np.maximum(most, plane)
        start += 64
    slack = 1e-6 * most.max()
    beyond = (seen.least > least + slack) | (most > seen.most + slack)
    assert not beyond[seen.certain].any()
    # Where the interval is an estimate, what is thinner than a pixel may pass between two looks.
    assert beyond.mean() < 0.003
    assert (seen.least <= seen.most).all()
    # What does not move is known exactly, and something does.
    still = seen.steady
    assert still.any() == (name != "step")
    np.testing.assert_allclose(least[still], most[still], rtol=1e-6, atol=slack)
    assert not (least == most).all()
    assert isinstance(source, Sketched) == (not seen.certain.all())


def test_tiles_of_a_plane_cover_it_once():
    grid = TileGrid(50, 70)
    seen = np.zeros((50, 70), int)
    for tile in range(len(grid)):
        y0, y1, x0, x1 = grid.box(tile)
        seen[y0:y1, x0:x1] += 1
    assert (seen == 1).all() and grid.shape == (4, 5)
    assert grid.whole.sum() == 12
    plane = np.arange(3500.0).reshape(50, 70)
    y0, y1, x0, x1 = grid.box(7)
    assert grid.reduce(plane, np.maximum)[7] == plane[y0:y1, x0:x1].max()
    assert grid.groups(np.arange(20)).shape == (50, 5)


def planned(device: Device, name: str, *assignments: str, tolerance: float, **how: Any) -> RunPlan:
    _, scenario = load(name, ["sensor.chip=spikeone", *assignments])
    setup = set_up_camera(scenario, None)
    return plan_run(setup.survey, setup.setting, tolerance, setup.spans, device, **how)


BRIGHT = (
    "scene.rotation=0 Hz", "sensor.preset=silicon", "sensor.threshold=100 ke", "image.window=201",
    "scene.illuminance=50 klx",
    "duration=10 ms",
)  # fmt: skip
DARK = (
    "sensor.threshold=100 e",
    "scene.before=0.05",
    "scene.after=0.1",
    "scene.at=2 ms",
    "duration=10 ms",
)


def test_scenes_keep_what_they_need(device):
    """A bright still scene does without its noise, at a third of the cost; a dark one needs it; in
    one that moves it matters when a row is sampled."""
    bright = planned(device, "star", *BRIGHT, tolerance=0.05)
    assert {"shot noise", "threshold noise"} <= set(bright.plan.left_out)
    assert bright.plan.kept["shot noise"].mean() < 0.25
    assert bright.plan.full_ns >= 3 * bright.plan.cost_ns
    assert bright.survey.classes["moving"] == 0
    dark = planned(device, "step", *DARK, "sensor.preset=silicon", tolerance=0.05)
    assert dark.plan.kept["shot noise"].all()
    fast = planned(
        device, "star", "scene.rotation=400 Hz", "sensor.preset=silicon", "duration=5 ms",
        tolerance=0.05,
    )  # fmt: skip
    assert fast.plan.kept["row-by-row sampling"].all()
    assert fast.survey.classes["moving"] > 0
    shares = [tuple(kept.mean() for kept in p.plan.kept.values()) for p in (bright, dark, fast)]
    assert len(set(shares)) == 3
    assert bright.plan.kept["shot noise"].mean() < fast.plan.kept["shot noise"].mean() < 1


def test_tolerance_0_keeps_everything_in_the_exact_tier(device):
    plan = planned(device, "star", *BRIGHT, tolerance=0.0)
    assert plan.tier == "exact" and plan.plan.left_out == ()
    assert plan.plan.cost_ns == plan.plan.full_ns


def test_every_set_of_effects_is_checked_somewhere(device):
    plan = planned(device, "star", "sensor.dead_time=50 ns", "duration=10 ms", tolerance=0.0)
    kept = {name: tiles.copy() for name, tiles in plan.plan.kept.items()}
    kept["shot noise"][[205, 206]] = False  # in the middle, where nothing else calls for a check
    kept["reset dead time"][[206, 207]] = False
    plan = replace(plan, plan=replace(plan.plan, kept=kept))
    assert len(plan.plan.sets) == 4
    tiles = plan.patches(1)
    kept = np.stack(list(plan.plan.kept.values()))
    whole = plan.survey.grid.whole
    sets = {tuple(column) for column in kept[:, whole].T}
    assert {tuple(column) for column in kept[:, tiles].T} == sets
    assert len(tiles) == len(set(tiles)) and whole[tiles].all()


def test_a_forced_effect_stays(device):
    _, scenario = load("star", ["sensor.chip=spikeone", *BRIGHT])
    setup = set_up_camera(scenario, None)
    forced = setup.plan(0.02, forced=["threshold noise"])
    assert forced.plan.kept["threshold noise"].all()
    assert "threshold noise" in {effect.name for effect in forced.setting.acting_effects}
    assert replace(forced.setting, threshold_noise=0.0) != forced.setting


def test_noise_comes_from_the_bank_where_that_is_cheaper(device):
    plan = planned(device, "star", "sensor.threshold=1 ke", "duration=10 ms", tolerance=1e-2)
    assert plan.tier == "fast" and plan.flags is not None
    bank = (plan.flags & BANK) != 0
    kept = plan.survey.grid.groups(plan.plan.kept[OWN_DRAWS] | plan.fine)
    noise = plan.survey.grid.groups(plan.plan.kept["shot noise"])
    assert bank.any() and np.array_equal(bank, noise & ~kept)
    never = planned(
        device, "star", "sensor.threshold=1 ke", "duration=10 ms", tolerance=0.0, tier="fast"
    )
    assert never.flags is not None and not (never.flags & BANK).any()


def test_a_tile_of_the_bank_needs_no_reference_for_an_event_that_it_will_not_have(device):
    """A clip whose white comes near a spike a cycle. In a tile that draws from the bank, spikes are
    those of the reference in law only."""
    sets = (
        "sensor.chip=spikeone", "sensor.threshold=1 ke", "sensor.preset=silicon",
        "sensor.lens.white_rate=0.8", "duration=5 ms",
    )  # fmt: skip
    plan = planned(device, "film", *sets, tolerance=1e-3)
    scene, setting = plan.survey.scene, plan.full
    alone = fast_error(setting, scene)
    banked = fast_error(setting, scene, np.ones(alone.size, bool))
    most = FAST_PART * SHARE * accepted_error(1e-3)
    assert plan.tier == "fast" and (banked <= alone).all()
    assert plan.fine[banked > most].all() and (alone[plan.fine] > most).all()
    spared = ~plan.fine & (alone > most)
    # The tiles that draw for each spike are compared spike by spike.
    assert spared.any() and not plan.plan.kept[OWN_DRAWS][spared].any()
    own = planned(device, "film", *sets, tolerance=1e-3, forced=[OWN_DRAWS])
    assert own.tier != "fast" or (own.fine == (alone > most)).all()


def test_the_exact_tier_takes_tiles_in_which_light_falls_from_above_the_longest_threshold(device):
    """The fast tier subtracts thresholds at their mean there, which moves the phase by a spike."""
    _, scenario = load("star", [
        "sensor.chip=spikeone", "sensor.threshold=1 ke", "sensor.lens.f_number=2",
        "scene.illuminance=50 klx", "duration=1.6 ms",
    ])  # fmt: skip
    setup = set_up_camera(scenario, None)
    plan = plan_run(setup.survey, setup.setting, 1e-2, setup.spans, device)
    assert plan.tier == "fast" and plan.exact.any() and not (plan.fine & ~plan.exact).any()
    assert plan.flags is not None
    scene, lens = setup.stages(setup.source()).values()
    block = Block(0, 64)
    light = lens.step(scene.step(None, block), block)
    words = [
        camera.step(light, block).words
        for camera in (plan.camera(device), SpikeCamera(setup.setting, None))
    ]
    inside = np.repeat(plan.survey.grid.groups(plan.exact), TILE, axis=1)[:, : words[0].shape[2]]
    assert not plan.flags[plan.survey.grid.groups(plan.exact)].any()
    np.testing.assert_array_equal(words[0][:, inside], words[1][:, inside])
