"""The reference draws from the bank as the fast tier does, so that both agree spike by spike."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import PS, Light, Piece
from cosim.compute.opencl import Device
from sensor.device.pattern import DevicePattern
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.units import BANK, DEAD_TIME, NOISE, units_of
from sensor.latched.pixel.bank import bank_of, groups_of, offsets
from sensor.latched.pixel.model import ExactModel
from sensor.latched.reference import ReferencePixels
from sensor.latched.reference.bank_draws import bank_draws, bank_entry
from tests.sensor.latched.fast.test_fast import ALL, CLOCK, PERIOD

SHAPE = (64, 150)  # the last group of a row is not whole
N = SHAPE[0] * SHAPE[1]
NUMBERS = np.arange(N, dtype=np.uint32) + 777
GROUPS = np.ones((64, 10), bool)


def parted_share(model: ExactModel, dimmest: float, brightest: float, cycles: int) -> float:
    """Share of the pixels that draw from the bank whose spikes differ from those of the reference
    with the same draws.

    Draws of the bank belong to cycles. A spike that falls on the edge of a cycle in one tier and
    beyond it in the other therefore takes another threshold, and the pixel has other noise from
    then on, with the same distribution. A spike does so if the error of the accumulated charge is
    larger than its distance from the edge: with the chance error / light, so in n cycles such
    spikes number the sum of the errors over the cycles. It is an estimate: rounding errors count
    with their RMS, but all errors of a pixel with the same sign, as light may be constant.

    Args:
        model: rules of the pixel.
        dimmest, brightest: limits of the light, electrons a cycle.
        cycles: cycles of the run.
    """
    unit = 2.0 ** -units_of(model).bits
    low, high = dimmest / model.mean, brightest / model.mean
    a_cycle = unit / 2 + 2.0**-24 * high
    if model.dead:
        a_cycle += min(high, 1.0) * (unit + model.dead_time * (high - low))
    run = cycles
    if model.reset == "hard":  # errors end with the interval
        run = min(cycles, math.ceil(1 / low)) if low > 0 else cycles
    return float(min(cycles * (2 * unit + run * a_cycle / 2), 1.0))


def test_compiled_places_are_those_of_numpy() -> None:
    random = np.random.default_rng(1)
    groups = random.integers(0, 2**32, 300, dtype=np.uint32)
    cycles = random.integers(0, 2**33, 300)
    model = ExactModel(1000.0, 5, ALL)
    draws = bank_draws(model, groups, (300, 1), np.ones((300, 1), bool))
    for crossing in range(4):
        found = [bank_entry(k, 3, c, crossing) for k, c in zip(draws.keys, cycles, strict=True)]
        expected = offsets(groups, cycles.astype(np.uint64), crossing, 5) + 3
        np.testing.assert_array_equal(found, expected)


def test_thresholds_are_those_of_the_fast_tier() -> None:
    model = ExactModel(1000.0, 5, ALL)
    draws = bank_draws(model, NUMBERS, SHAPE, GROUPS)
    first, lanes = groups_of(NUMBERS, SHAPE)
    cycles = np.arange(N, dtype=np.uint32)
    units = bank_of(model, 28).draw(first, lanes, cycles, 0, 5)
    electrons = draws.draw(model, np.arange(N), cycles, 0)
    np.testing.assert_array_equal(electrons, units / 2.0**28 * 1000)


def both(
    device: Device,
    model: ExactModel,
    light: Light,
    cuts: list[int],
    pattern: Any = None,
    groups: npt.NDArray[np.bool_] = GROUPS,
) -> tuple[FastPixels, ReferencePixels, npt.NDArray[np.bool_], npt.NDArray[np.uint32]]:
    """Pixels of both tiers after a run, those whose spikes differ, and the words."""
    gain = model.threshold * 40_000
    flags = np.where(groups, BANK | NOISE | DEAD_TIME, NOISE | DEAD_TIME).astype(np.uint8)
    fast = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, gain, pattern, None, flags), device)
    reference = ReferencePixels(
        model, NUMBERS, CLOCK, gain, pattern, bank=bank_draws(model, NUMBERS, SHAPE, groups)
    )
    one, two = (
        np.concatenate([pixels.expose(light, a, b - a) for a, b in itertools.pairwise(cuts)])
        for pixels in (fast, reference)
    )
    return fast, reference, (one != two).any(axis=0), one


def lights(low: float, high: float) -> dict[str, Light]:
    random = np.random.default_rng(2)
    planes = [random.uniform(low, high, SHAPE).astype(np.float32) for _ in range(60)]
    knots = np.cumsum([0, *random.integers(3 * PERIOD, 30 * PERIOD, 59)]).tolist()
    ramps = [
        Piece(a, b, p, q)
        for (a, b), (p, q) in zip(
            itertools.pairwise(knots), itertools.pairwise(planes), strict=True
        )
    ]
    last = planes[-1]
    return {
        "still": Light((Piece(0, PS, planes[0], planes[0]),)),
        "ramps": Light((*ramps, Piece(knots[-1], PS, last, last))),
    }


@pytest.mark.parametrize("name", ["still", "ramps"])
@pytest.mark.parametrize("electrons", [100.0, 1000.0, 30_000.0])
def test_all_but_few_pixels_have_the_same_spikes(
    device: Device, electrons: float, name: str
) -> None:
    model, cycles = ExactModel(electrons, 3, ALL), 800
    # From dim light to several thresholds a cycle in some.
    for low, high in ((0.05, 0.6), (0.7, 1.2)):
        light = lights(low, high)[name]
        fast, reference, parted, words = both(device, model, light, [0, 320, 800])
        bound = parted_share(model, low * electrons, high * electrons, cycles)
        assert 1e-4 < bound < 0.05
        assert parted.mean() <= bound
        assert np.bitwise_count(words).sum() > 0.05 * N * cycles
        away = np.abs(fast.fraction() - reference.fraction())[~parted]
        # Pixels that fire in every cycle may part without a difference of spikes.
        assert np.mean(away > 1e-4) <= bound / 10


def test_with_a_fixed_pattern_the_share_is_within_its_estimate(device: Device) -> None:
    model, cycles = ExactModel(1000.0, 3, ALL), 1600
    pattern = DevicePattern(prnu=0.02, dark=100.0, dsnu=0.2, device_seed=3).at(NUMBERS)
    *_, parted, _ = both(device, model, lights(0.1, 0.5)["still"], [0, cycles], pattern)
    assert 0 < parted.mean() <= parted_share(model, 80.0, 600.0, cycles) < 0.1


@pytest.mark.parametrize("reset", ["hard", "subtract"])
def test_under_the_other_reset_rules_too(device: Device, reset: Any) -> None:
    model, cycles = ExactModel(1000.0, 3, ALL, reset=reset), 640
    fast, reference, parted, _ = both(device, model, lights(0.1, 0.7)["ramps"], [0, 64, cycles])
    assert parted.mean() <= parted_share(model, 100.0, 700.0, cycles) < 0.02
    assert np.abs(fast.fraction() - reference.fraction())[~parted].max() < 1e-4


def test_dead_time_parts_more_pixels(device: Device) -> None:
    # 0.25 is a whole number of 2^-16 cycles; under light that changes, both tiers lose other light.
    model, cycles = ExactModel(1000.0, 3, ALL, dead_time=0.25), 320
    still = lights(0.1, 0.7)["still"]
    *_, parted, _ = both(device, model, still, [0, cycles])
    assert parted.mean() < 0.05
    assert parted_share(model, 100.0, 700.0, cycles) == 1.0


def test_groups_of_both_kinds_in_one_plane(device: Device) -> None:
    model = ExactModel(1000.0, 3, ALL)
    groups = np.random.default_rng(1).random((64, 10)) < 0.5
    fast, reference, parted, words = both(
        device, model, lights(0.1, 0.7)["ramps"], [0, 100 * 32], groups=groups
    )
    assert parted.mean() < 0.05
    mine = np.repeat(groups, 16, axis=1)[:, :150].ravel()
    alone = both(device, model, lights(0.1, 0.7)["ramps"], [0, 100 * 32])[3]
    assert (words[:, mine] == alone[:, mine]).all() and (words != alone)[:, ~mine].any(axis=0).all()
    assert (reference.state()["spikes"][mine] < 2 * 3200 + 2).all()
    same = ~parted & mine
    assert np.array_equal(reference.state()["spikes"][same], fast.state()["spikes"][same])


def test_a_run_goes_on_from_a_state(device: Device) -> None:
    model, light = ExactModel(1000.0, 3, ALL), lights(0.1, 1.3)["ramps"]
    draws = bank_draws(model, NUMBERS, SHAPE, GROUPS)
    once = ReferencePixels(model, NUMBERS, CLOCK, 4e7, bank=draws)
    whole = once.expose(light, 0, 192)
    one = ReferencePixels(model, NUMBERS, CLOCK, 4e7, bank=draws)
    first = one.expose(light, 0, 96)
    two = ReferencePixels(model, NUMBERS, CLOCK, 4e7, bank=draws)
    two.restore(one.state())
    assert np.array_equal(np.concatenate([first, two.expose(light, 96, 96)]), whole)


def test_both_tiers_take_over_alike(device: Device) -> None:
    light = lights(0.2, 0.6)["still"]
    made = []
    for model in (ExactModel(1000.0, 3, ALL), ExactModel(800.0, 3, ALL)):
        flags = np.full((64, 10), BANK | NOISE, np.uint8)
        array = PixelArray(model, SHAPE, NUMBERS, CLOCK, 4e7, None, None, flags)
        draws = bank_draws(model, NUMBERS, SHAPE, GROUPS)
        made.append((
            FastPixels(array, device), ReferencePixels(model, NUMBERS, CLOCK, 4e7, bank=draws)
        ))  # fmt: skip
    fresh = np.arange(N) % 5 == 0
    words, fires = [], []
    for before, after in zip(*made, strict=True):
        first = before.expose(light, 0, 64)
        fires.append(after.take_over(before, 64, fresh, 1 << 40))
        words.append(np.concatenate([first, after.expose(light, 64, 128)]))
    parted = (words[0] != words[1]).any(axis=0)
    assert parted.mean() < 1e-3
    assert np.array_equal(fires[0][~parted], fires[1][~parted]) and fires[0].any()
    away = np.abs(made[1][0].fraction() - made[1][1].fraction())[~parted]
    assert away.max() < 1e-5
