"""What may be left out of asynchronous pixels: bounds against what leaving out does, and the pixels
run by a plan against the engine."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import PS, Clock, InputError, Light, Piece
from cosim.plan.planner import ESTIMATE_WEIGHT
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.pixel.closed import ClosedPixels
from sensor.asynchronous.pixel.reference import follow
from sensor.asynchronous.plan.effects import SIDE, summarise
from sensor.asynchronous.plan.plan import EventPlan, PlannedPixels, plan_events
from sensor.device.pattern import DevicePattern

FOREVER = 2**62
SHAPE = (48, 64)
DEVICE = DevicePattern(
    prnu=0.02, dark=50.0, dsnu=0.3, threshold_fpn=0.01, hot=0.05, hot_current=200.0, dead=0.02,
    device_seed=4,
)  # fmt: skip


def model(threshold: int = 300, **more: Any) -> EventModel:
    given = {"shortest": 10_000, "change": 8.0, **more}
    return EventModel(threshold, 1, Clock(10**9), **given)


def sky(seed: int = 1) -> Light:
    """Four even tiles of each of three levels; half of each tile of the last row is dark."""
    levels = np.repeat([3e3, 3e5, 3e9], SIDE)
    plane = np.repeat(levels[:, None], SHAPE[1], 1).astype(np.float32)
    plane[-SIDE:, ::2] = 0
    return Light((Piece(0, FOREVER, plane, plane),))


def plan_for(
    setting: EventModel, device: DevicePattern | None, tolerance: float, stop: int = PS
) -> EventPlan:
    rate = sky().pieces[0].first.ravel().astype(np.float64)
    return plan_events(summarise(setting, device, rate, SHAPE, stop, True), device, tolerance)


def widths(firings: Firings) -> npt.NDArray[np.float64]:
    """First widths of all pixels, NaN for the silent."""
    found = np.full(SHAPE[0] * SHAPE[1], np.nan)
    pixel, first = np.unique(firings.pixel, return_index=True)
    found[pixel] = firings.exact[first]
    return found


# Plans.


def test_tolerance_zero_and_light_that_changes_keep_everything():
    assert not plan_for(model(), DEVICE, 0.0).left_out.any()
    rate = np.full(SHAPE[0] * SHAPE[1], 1e9)
    moving = summarise(model(), DEVICE, rate, SHAPE, PS, False)
    assert not plan_events(moving, DEVICE, 1.0).left_out.any()


@pytest.mark.parametrize("tolerance", [1e-6, 1e-4, 1e-2, 0.1, 1.0])
def test_what_is_left_out_sums_to_half_the_tolerance_at_most(tolerance):
    plan = plan_for(model(), DEVICE, tolerance)
    total = np.where(plan.left_out, list(plan.plan.promise.values()), 0).sum(0)
    assert (total <= tolerance / 2).all() and total == pytest.approx(plan.plan.total)
    kept = [n for n, e in enumerate(plan.effects) if e.cost(plan.scene) == 0]
    assert len(kept) == 3 and not plan.left_out[kept].any()


def test_more_is_left_out_the_more_is_tolerated():
    out = [plan_for(model(), DEVICE, t).left_out.sum() for t in (0, 1e-6, 1e-3, 0.1, 1, 100)]
    assert out == sorted(out) and out[0] == 0 and len(set(out)) > 3
    # In the end all that can be: six effects in twelve tiles.
    assert out[-1] == 6 * 12


def test_the_bound_of_shot_noise_is_the_deviation_of_an_inverse_gamma():
    plan = plan_for(model(), None, 0.0)
    g = np.random.default_rng(3).gamma(300, size=10**6)
    spread = float((300 / g).std())
    bright = plan.plan.promise["shot noise"][4]  # an even tile above the floor
    # 256 pixels: a margin for what they turn out to be, and for the limit measured of it.
    assert spread < bright < 1.5 * spread
    # A pixel that says less than the floor, one spike in the run, counts against the floor.
    dim = plan_for(model(), None, 0.0, stop=PS // 100)
    assert dim.plan.promise["shot noise"][0] == pytest.approx(bright * 3e3 / 300 / 100, rel=2e-5)


def test_the_bound_of_later_reports_is_a_ratio_of_two_widths():
    """P(w'/w leaves 1 by change/sqrt(Q)), drawn 4e6 times."""
    setting = model(100, change=4.0)
    plan = plan_for(setting, None, 0.0, stop=1000)
    rng = np.random.default_rng(1)
    ratio = rng.gamma(100, size=4 * 10**6) / rng.gamma(100, size=4 * 10**6)
    often = float((np.abs(ratio - 1) > 0.4).mean())
    scene = plan.scene
    share = (
        plan.plan.promise["later reports"] / ESTIMATE_WEIGHT * scene.scale / (2 / 3) / scene.rms
    ) ** 2
    expected = scene.brightest * scene.stop * often
    assert share[expected < 1] == pytest.approx(expected[expected < 1], rel=0.02)


@pytest.mark.parametrize("q", [1, 2, 3])
def test_thresholds_without_a_variance_are_never_left_out_by_a_bound(q):
    plan = plan_for(model(q), DEVICE, 1.0)
    assert not plan.where("shot noise").any() or q > 2
    assert not np.isnan(list(plan.plan.promise.values())).any()


# Bounds hold.


def test_rows_state_bounds_as_they_count() -> None:
    """Estimates at twice their size, as everywhere: those of what is left out add up."""
    plan = plan_for(model(300), DEVICE, 0.5)
    estimates = [row for row in plan.rows if row.kind == "estimate" and row.bound > 0]
    assert {"threshold FPN", "hot and dead pixels"} <= {row.effect for row in estimates}
    for row in plan.rows:
        assert row.bound == pytest.approx(float(plan.plan.promise[row.effect].max()), rel=1e-6)
    assert sum(row.bound for row in plan.absent) >= float(plan.plan.total.max())


@pytest.mark.parametrize("q", [30, 300, 5000])
@pytest.mark.parametrize(
    "name",
    ["shot noise", "PRNU", "dark current and DSNU", "threshold FPN", "hot and dead pixels"],
)
def test_leaving_an_effect_out_changes_no_tile_by_more_than_its_bound(q, name):
    """The rate each pixel says first, with everything and without the one effect."""
    setting, light, stop = model(q), sky(), 2 * PS
    full = plan_for(setting, DEVICE, 0.0, stop)
    every = np.ones(full.scene.mean.size, np.bool_)
    without = replace(full, plan=replace(full.plan, kept=full.plan.kept | {name: ~every}))
    kinds = {row.effect: row.kind for row in full.plan.rows}
    bound = full.plan.promise[name] / (ESTIMATE_WEIGHT if kinds[name] == "estimate" else 1)
    made = [
        widths(PlannedPixels(p, DEVICE, SHAPE, 1.0).step(light, 0, stop)) for p in (full, without)
    ]
    # Pixels silent in either are the floor's affair, compared in the runs' own verification.
    both = ~np.isnan(made[0]) & ~np.isnan(made[1])
    apart = np.where(both, PS / made[0] - PS / made[1], 0.0) ** 2
    tile = full.scene.tile_of
    rms = np.sqrt(np.bincount(tile, apart) / full.scene.pixels) / full.scene.scale
    assert (rms <= bound * (2 if name == "hot and dead pixels" else 1)).all()
    lit = np.bincount(tile, both) > 200
    assert lit.any() and (rms[lit] > 0).all()
    if name != "hot and dead pixels":  # nor is it idle: within a factor of two where all is even
        assert (rms[4:8] > bound[4:8] / 2).all()


# Pixels run by a plan.


def test_nothing_left_out_is_the_engine_to_the_last_bit():
    setting, light = model(change=3.0), sky()
    plan = plan_for(setting, DEVICE, 0.0)
    one = PlannedPixels(plan, DEVICE, SHAPE, 1.0).step(light, 0, PS // 1000)
    two = AsynchronousPixels(setting, SHAPE, 1.0, DEVICE).step(light, 0, PS // 1000)
    for name in ("pixel", "instant", "width", "exact", "level"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_first_spikes_in_closed_form_are_the_engines_to_the_last_bit():
    setting, light = model(delay=1234), sky()
    every = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32)
    closed = ClosedPixels(setting, SHAPE, 1.0, DEVICE, every).unordered(light, 0, PS)
    engine = AsynchronousPixels(setting, SHAPE, 1.0, DEVICE).step(light, 0, PS)
    _, first = np.unique(engine.pixel, return_index=True)
    assert len(closed) == first.size > 2000
    for name in ("pixel", "instant", "width", "exact", "level"):
        assert np.array_equal(getattr(closed, name), getattr(engine, name)[first])


def test_without_anything_left_a_width_is_a_quotient():
    plan = plan_for(model(), DEVICE, 100.0)
    pixels = PlannedPixels(plan, DEVICE, SHAPE, 1.0)
    assert [pattern for _, _, pattern in pixels.groups] == [None]
    fired = pixels.step(sky(), 0, PS)
    light = sky().pieces[0].first.ravel()[fired.pixel].astype(np.float64)
    assert len(fired) == (light > 0).sum() > 2500
    assert fired.exact == pytest.approx(np.maximum(300 / light * PS, 10_000), rel=1e-14)


@pytest.mark.parametrize("tolerance", [1e-3, 0.1, 0.5])
def test_any_split_and_any_choice_of_pixels_give_the_same_bits(tolerance):
    setting, light, stop = model(100, change=5.0), sky(), PS
    plan = plan_for(setting, DEVICE, tolerance, stop)
    assert plan.left_out.any()
    whole = PlannedPixels(plan, DEVICE, SHAPE, 1.0).step(light, 0, stop)
    some = np.random.default_rng(2).permutation(3072)[:500].astype(np.uint32)
    some.sort()
    pixels = PlannedPixels(plan, DEVICE, SHAPE, 1.0, numbers=some)
    cuts = [0, 20_000, 10**6, 10**9 + 1, 10**11, stop]
    parts = [pixels.step(light, a, b) for a, b in pairwise(cuts)]
    split, mine = Firings.join(parts), whole.take(np.isin(whole.pixel, some))
    assert len(split) > 300
    for name in ("pixel", "instant", "width", "exact", "level"):
        assert np.array_equal(getattr(split, name), getattr(mine, name))


def test_the_plan_at_1e_3_is_within_it_of_the_reference():
    setting, light, stop = model(), sky(), PS
    device = DevicePattern(prnu=0.02, dark=50.0, dsnu=0.3)
    plan = plan_for(setting, device, 1e-3, stop)
    assert plan.where("dark current and DSNU").any()
    fired = PlannedPixels(plan, device, SHAPE, 1.0).step(light, 0, stop)
    every = np.arange(3072, dtype=np.uint32)
    truth = follow(setting, every, light, 1.0, device, stop, 1)
    rate = PS / widths(fired)
    both = ~np.isnan(rate) & (truth.count == 1)
    assert both.sum() > 2500
    apart = np.where(both, rate - PS / np.where(both, truth.exact[:, 0], 1.0), 0.0) ** 2
    rms = np.sqrt(np.bincount(plan.scene.tile_of, apart) / plan.scene.pixels)
    assert (rms / plan.scene.scale < 5e-4).all()


def test_too_many_events_of_all_groups_together_are_refused():
    plan = plan_for(model(), DEVICE, 0.1)
    pixels = PlannedPixels(plan, DEVICE, SHAPE, 1.0, most=1000)
    with pytest.raises(InputError, match="the events must be at most 1,000, not more"):
        pixels.step(sky(), 0, PS)


def test_closed_form_refuses_pixels_that_say_more():
    every = np.arange(4, dtype=np.uint32)
    for setting in (model(change=0.0), model(longest=PS)):
        with pytest.raises(ValueError, match="must have change > 0 and no longest width"):
            ClosedPixels(setting, (2, 2), 1.0, None, every)
    pixels = ClosedPixels(model(), (2, 2), 1.0, None, every)
    low, high = np.ones((2, 2), np.float32), np.full((2, 2), 2, np.float32)
    below = -low
    with pytest.raises(ValueError, match="must be steady"):
        pixels.unordered(Light((Piece(0, PS, low, high),)), 0, PS)
    with pytest.raises(ValueError, match="0 or more"):
        pixels.unordered(Light((Piece(0, PS, below, below),)), 0, PS)
    with pytest.raises(ValueError, match="must fall on"):
        pixels.unordered(sky(), 0, PS)


def test_a_part_of_a_pattern_is_that_part_of_the_whole():
    """What has no size is not drawn, and changes nothing of the rest."""
    numbers = np.arange(1000, dtype=np.uint32)
    whole = DevicePattern(prnu=0.1, dark=5.0, dsnu=0.2, device_seed=9).at(numbers)
    assert np.array_equal(DevicePattern(prnu=0.1, device_seed=9).at(numbers).gain, whole.gain)
    other = DevicePattern(dark=5.0, dsnu=0.2, device_seed=9).at(numbers)
    assert np.array_equal(other.dark, whole.dark) and (other.gain == 1).all()
