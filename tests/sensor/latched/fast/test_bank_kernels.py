"""Groups that draw from the bank: kernels against numpy bit for bit, in any calls and tiles."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import PS, Light, Piece
from cosim.compute.opencl import Device
from sensor.device.pattern import DevicePattern
from sensor.latched.effects.drift import Drift
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.taking_over import taken_over
from sensor.latched.fast.units import BANK, DEAD_TIME, NOISE
from sensor.latched.pixel.bank import PERIOD as REPEATS
from sensor.latched.pixel.model import ExactModel, Reset
from sensor.latched.sampling import RowTiming, row_offsets
from tests.sensor.latched.fast.numpy_fast import NumpyFast
from tests.sensor.latched.fast.test_fast import (
    ALL,
    CLOCK,
    NUMBERS,
    PERIOD,
    SHAPE,
    boxed,
    cut_out,
    run,
)
from tests.sensor.latched.piecewise import level, light_between

BANKED = np.full((7, 3), BANK | NOISE | DEAD_TIME, np.uint8)
WIDTH, HEIGHT = 85, 5  # six groups, so that a work-item has four and another two
WIDE = (HEIGHT, WIDTH)
KNOTS = [0, 3 * PERIOD + 5, 9 * PERIOD, 9 * PERIOD + PERIOD // 3, 60 * PERIOD, 400 * PERIOD]


def array(model: ExactModel, shape: tuple[int, int], brightest: float, **others: Any) -> PixelArray:
    """Pixels that all draw from the bank, under light whose 700 units are `brightest` thresholds a
    cycle."""
    n = shape[0] * shape[1]
    flags = np.full((shape[0], -(-shape[1] // 16)), BANK | NOISE | DEAD_TIME, np.uint8)
    numbers = others.pop("numbers", np.arange(n, dtype=np.uint32) + 5000)
    gain = model.threshold * 40_000 * brightest / 700
    return PixelArray(model, shape, numbers, CLOCK, gain, flags=flags, **others)


def same(array: PixelArray, device: Device, light: Light, cuts: list[int]) -> npt.NDArray[Any]:
    """Runs both forms, holds them equal, and returns the bits."""
    fast, plain = FastPixels(array, device), NumpyFast(array)
    found, expected = run(fast, light, cuts), run(plain, light, [cuts[0], cuts[-1]])
    assert np.array_equal(found, expected)
    for key, values in plain.state().items():
        assert np.array_equal(fast.state()[key], values), key
    assert np.array_equal(fast.fraction(), plain.fraction())
    return found


@pytest.mark.parametrize("flag", [0, DEAD_TIME, NOISE, NOISE | BANK])
def test_work_groups_of_a_gpu_give_the_same_bits(device: Device, flag: int) -> None:
    gpu = Device(device.handle, device.name)
    gpu.gpu = True
    pixels = array(ExactModel(300.0, 7, ALL, dead_time=0.2), WIDE, 0.7)
    flags = np.full((HEIGHT, -(-WIDTH // 16)), flag, np.uint8)
    flags[2, 1:4] = NOISE
    still = level(WIDE, 3, 700.0)
    for light in (light_between(WIDE, KNOTS, True), Light((Piece(0, PS, still, still),))):
        same(replace(pixels, flags=flags), gpu, light, [0, 5, 64, 130])


@pytest.mark.parametrize("dead", [0.0, 0.3])
@pytest.mark.parametrize("brightest", [0.5, 1.2, 1.7, 9.0])
@pytest.mark.parametrize(("reset", "electrons"), [
    ("residual", 50.0), ("residual", 1000.0), ("hard", 300.0), ("subtract", 300.0),
])  # fmt: skip
def test_kernels_agree_with_numpy(
    device: Device, reset: Reset, electrons: float, brightest: float, dead: float
) -> None:
    model = ExactModel(electrons, 7, ALL, dead_time=dead, reset=reset)
    pixels = array(model, WIDE, brightest)
    still = level(WIDE, 3, 700.0)
    for light in (
        light_between(WIDE, KNOTS, True),
        Light((Piece(0, PS, still, still),)),
    ):
        found = same(pixels, device, light, [0, 5, 37, 64, 130, 171])
        assert found.mean() > 0.02


@pytest.mark.parametrize("seed", range(4))
def test_with_every_other_effect_too(device: Device, seed: int) -> None:
    model = ExactModel(400.0, seed, ALL, threshold_noise=8.0, dead_time=0.1 * (seed % 2))
    numbers = np.arange(WIDTH * HEIGHT, dtype=np.uint32)
    pattern = DevicePattern(
        prnu=0.1, dark=400.0, dsnu=0.2, threshold_fpn=0.02, hot=0.05, hot_current=1e7,
        dead=0.05, device_seed=3,
    ).at(numbers)  # fmt: skip
    timing = RowTiming(0.1, 0.01, 0.5, 2.0).on(numbers, np.arange(HEIGHT), HEIGHT, seed)
    pixels = array(
        model, WIDE, 1.3, numbers=numbers, pattern=pattern,
        offsets=row_offsets(CLOCK, HEIGHT, 0.8, 1e-5, (0, 5)),
        timing=timing if seed > 1 else None,
    )  # fmt: skip
    same(pixels, device, light_between(WIDE, KNOTS, True), [0, 3, 32, 33, 100, 190])


@pytest.mark.parametrize("brightest", [0.35, 0.75, 2.5])
@pytest.mark.parametrize("dead", [0.0, 0.1])
@pytest.mark.parametrize("reset", ["residual", "hard"])
def test_noisy_rows_of_any_light_agree_with_numpy(
    device: Device, brightest: float, dead: float, reset: Reset
) -> None:
    """Light that crosses one threshold a cycle at most, two, and more."""
    model = ExactModel(400.0, 5, ALL, dead_time=dead, reset=reset)
    pattern = DevicePattern(prnu=0.02, dark=400.0, dsnu=0.2, dead=0.05, device_seed=3).at(
        np.arange(WIDTH * HEIGHT, dtype=np.uint32)
    )
    numbers = np.arange(WIDTH * HEIGHT, dtype=np.uint32)
    timing = RowTiming(0.1, 0.01, 0.5, 5.0).on(numbers, np.arange(HEIGHT), HEIGHT, 2)
    offsets = row_offsets(CLOCK, HEIGHT, 0.8, 1e-5, (0, HEIGHT))
    for fixed in (pattern, None):
        pixels = array(
            model, WIDE, brightest, numbers=numbers, pattern=fixed, offsets=offsets, timing=timing
        )
        same(pixels, device, light_between(WIDE, KNOTS, True), [0, 3, 32, 100, 190])


def test_light_that_does_not_change_is_the_same_inside_a_box_and_outside(device: Device) -> None:
    model = ExactModel(1000.0, 1, ALL)
    plane = level(WIDE, 5, 700.0)
    moving = Light(tuple(
        Piece(a * PERIOD, b * PERIOD, plane, plane.copy()) for a, b in itertools.pairwise(range(60))
    ))  # fmt: skip
    still = Light((Piece(0, PS, plane, plane),))
    pixels = array(model, WIDE, 1.4)
    one = run(FastPixels(pixels, device), still, [0, 50])
    assert np.array_equal(one, run(FastPixels(pixels, device), moving, [0, 20, 50]))


def test_only_words_in_which_the_gain_changes_have_the_whole_plane_as_their_box(
    device: Device,
) -> None:
    model = ExactModel(400.0, 3, ALL, dead_time=0.1)
    offsets = row_offsets(CLOCK, HEIGHT, 0.8, 0.0, (0, HEIGHT))
    pixels = array(model, WIDE, 0.9, offsets=offsets)
    pixels.flags[2] = NOISE
    pixels.flags[3] = 0
    plane, pieces = level(WIDE, 5, 700.0), []
    for n in range(0, 204, 3):  # a small box moves to the right
        box = (1, 4, n // 3, n // 3 + 9)
        last = plane.copy()
        last[1:4, box[2] : box[3]] = level(WIDE, n, 700.0)[1:4, box[2] : box[3]]
        pieces.append(Piece(n * PERIOD, (n + 3) * PERIOD, plane, last, box))
        plane = last
    light = Drift(CLOCK, 0.05, 3).on(Light(tuple(pieces)), 0, 200)
    assert pixels.parts(light, 0, 64) == [(0, 32), (32, 32)]
    assert pixels.parts(light, 64, 64) == [(0, 64)]
    assert pixels.parts(light, 100, 70) == [(0, 32), (32, 32), (64, 6)]
    same(pixels, device, light, [0, 64, 100, 170, 199])


def test_a_tile_gives_the_bits_of_the_whole_and_a_restored_run_goes_on(device: Device) -> None:
    light, model = boxed(3, 700.0, 30), ExactModel(200.0, 5, ALL, dead_time=0.1)
    gain, numbers = 200.0 * 40_000 / 900, np.arange(NUMBERS.size, dtype=np.uint32)
    offsets = row_offsets(CLOCK, 7, 1.0, 0.0, (0, 7))
    whole = PixelArray(model, SHAPE, numbers, CLOCK, gain, None, offsets, BANKED)
    pixels = FastPixels(whole, device)
    found = run(pixels, light, [0, 45])
    kept = pixels.state()
    later = run(pixels, light, [45, 128])
    place = np.ix_([5, 1, 6], np.r_[16:32])
    part = cut_out(light, place)
    mine = numbers.reshape(SHAPE)[place].ravel()
    tile = PixelArray(model, (3, 16), mine, CLOCK, gain, None, offsets[[5, 1, 6]], BANKED[:3, :1])
    assert np.array_equal(run(FastPixels(tile, device), part, [0, 31, 45]), found[:, mine])
    again = FastPixels(whole, device)
    again.restore(kept)
    assert np.array_equal(run(again, light, [45, 128]), later)
    assert found.any() and later.any()


def test_draws_do_not_depend_on_the_light_of_others(device: Device) -> None:
    model = ExactModel(1000.0, 1, ALL)
    dim, bright = level(WIDE, 5, 700.0), level(WIDE, 6, 700.0)
    bright[:, 20] = dim[:, 20]
    pixels = array(model, WIDE, 0.9)
    one, two = (
        run(FastPixels(pixels, device), Light((Piece(0, PS, p, p),)), [0, 200])
        for p in (dim, bright)
    )
    column = np.arange(WIDTH * HEIGHT).reshape(WIDE)[:, 20]
    assert np.array_equal(one[:, column], two[:, column]) and one[:, column].any()
    assert np.mean(one != two) > 0.1


def test_draws_repeat_after_their_period(device: Device) -> None:
    plane = level(WIDE, 1, 700.0)
    light = Light((Piece(0, (REPEATS + 500) * PERIOD, plane, plane),))
    pixels = array(ExactModel(100.0, 1, ALL), WIDE, 0.9)
    at = REPEATS - 40
    found = same(pixels, device, light, [at, at + 37, at + 90])
    later = FastPixels(pixels, device)
    later.restore(FastPixels(pixels, device).state())
    assert np.array_equal(run(later, light, [at, at + 90]), found)


def test_models_without_a_bank_ignore_the_flag(device: Device) -> None:
    for model in (ExactModel(30.0, 1, ALL), ExactModel(100.0, 1, ())):
        pixels = array(model, WIDE, 0.9)
        assert not pixels.banked and not (pixels.group_flags & BANK).any()
    assert not (PixelArray(model, SHAPE, NUMBERS, CLOCK, 1.0).group_flags & BANK).any()


class TestWrites:
    """A write to the threshold's register."""

    def pixels(self, electrons: float, reset: Reset = "residual") -> PixelArray:
        return array(ExactModel(electrons, 3, ALL, reset=reset), WIDE, 0.5)

    def test_charge_and_threshold_go_on(self, device: Device) -> None:
        before, after = self.pixels(1000.0), self.pixels(800.0)
        old = FastPixels(before, device)
        light = light_between(WIDE, KNOTS, True)
        run(old, light, [0, 50])
        state = old.state()
        stored = old.fraction() * before.running(state["spikes"]) * 1000
        none = np.zeros(stored.size, bool)
        now, fires = taken_over(after, before, state, 50, none, 0)
        assert fires.any() and not fires.all()
        calm = ~fires
        threshold = after.running(now["spikes"])
        left = (now["charge"] + 1.0) / after.units.one
        np.testing.assert_allclose(
            (threshold - left)[calm] * 800, stored[calm], atol=800 * 2.0**-26
        )
        assert np.array_equal(now["spikes"][calm], state["spikes"][calm])
        # The others start the interval of the second threshold of that cycle.
        assert (now["spikes"][fires] == 2 * 51 + 1).all() and (now["charge"] >= 0).all()
        most = stored[fires] - before.running(state["spikes"])[fires] * 800
        assert (most <= 1000).all()

    def test_fresh_pixels_draw_in_the_cycle_before(self, device: Device) -> None:
        before, after = self.pixels(1000.0), self.pixels(800.0)
        old = FastPixels(before, device)
        run(old, light_between(WIDE, KNOTS, True), [0, 50])
        fresh = np.arange(WIDTH * HEIGHT) % 3 == 0
        now, fires = taken_over(after, before, old.state(), 50, fresh, 1 << 40)
        assert not fires[fresh].any()
        drawn = after.drawn(fresh, 49, 0)
        np.testing.assert_array_equal(now["charge"][fresh], drawn - 1)
        assert abs(drawn.mean() / after.units.one - 1) < 0.02

    def test_the_bank_must_be_that_of_all_levels(self, device: Device) -> None:
        before, after = self.pixels(1000.0), self.pixels(30.0)
        state, none = FastPixels(before, device).state(), np.zeros(WIDTH * HEIGHT, bool)
        with pytest.raises(ValueError, match="draw from the bank before and after a write"):
            taken_over(after, before, state, 0, none, 0)
