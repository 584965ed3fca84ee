"""Shot noise of continuous photographing against Campbell's theorem and first-passage theory.

Seeds are fixed; every bound is at alpha 1e-6 of its statistic (4.9 standard deviations).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import chi2, norm

from cosim import Clock, Light, Piece, intensity_image
from cosim.compute.philox import philox4x32
from cosim.compute.philox_compiled import random_words
from cosim.compute.streams import Stream
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.sampled import normal, quantile, quantile_table
from sensor.continuous.setting import ContinuousSetting, quiet_floor
from tests.sensor.continuous.first_passage import exit_time, sampled_exit_time
from tests.sensor.continuous.scene import TAU, current, light, run, setting

MS = 10**9
Z = float(norm.isf(0.5e-6))
CLOCK = Clock(100_000)  # ten looks a time constant
MANY = (100, 200)


def noisy(shape: tuple[int, int] = MANY, **changed: Any) -> ContinuousSetting:
    return setting(
        shape, **{"clock": CLOCK, "noise": True, "contrast": 0.0, "floor": 1e9, **changed}
    )


def check_mean_and_variance(values: np.ndarray, mean: float, variance: float) -> None:
    """z test of the mean, chi-square test of the variance about the known mean."""
    n = values.size
    assert abs(values.mean() - mean) < Z * math.sqrt(variance / n)
    square = float(((values - mean) ** 2).sum() / variance)
    assert chi2.ppf(0.5e-6, n) < square < chi2.isf(0.5e-6, n)


def test_normal_numbers_are_the_quantiles_of_philox_words() -> None:
    block, pixel, draw, seed = 2**40 + 7, 5, 1, 9
    ours = random_words(*(np.uint64(x) for x in (pixel, block, draw, seed, Stream.CONTINUOUS)))
    assert [int(w) for w in ours] == [
        int(w)
        for w in philox4x32(
            (pixel, block >> 32, block & 0xFFFFFFFF, draw), (seed, Stream.CONTINUOUS)
        )
    ]
    ends = np.concatenate([np.arange(3000), 2**32 - 1 - np.arange(3000)])
    words = np.concatenate([ends, np.random.default_rng(1).integers(0, 2**32, 20_000)])
    exact = ndtri((words + 0.5) / 2**32)
    table = quantile_table()
    np.testing.assert_allclose([quantile(np.uint64(w)) for w in words], exact, rtol=1e-13)
    np.testing.assert_allclose([normal(np.uint64(w), table) for w in words], exact, atol=3e-5)


def test_the_first_report_has_campbells_variance() -> None:
    given = light([(0, 3e7, None)], MS, MANY)
    i = float(current(given.pieces[0].first)[0, 0])
    for value in (0, 40):  # at once, and after 40 ticks
        camera = ContinuousCamera(noisy())
        if value:
            camera.step(given, 0, value * 10**7)
            seen = camera.state()["current"]
        else:
            seen = run(camera, given, [0, 10**7]).value
        check_mean_and_variance(seen, i, i / (2 * TAU))


def test_the_current_is_correlated_over_a_time_constant() -> None:
    given = light([(0, 3e7, None)], MS, MANY)
    camera = ContinuousCamera(noisy())
    camera.step(given, 0, 2 * 10**8)
    one = camera.state()["current"]
    camera.step(given, 2 * 10**8, 3 * 10**8)  # one time constant later
    i = float(current(given.pieces[0].first)[0, 0])
    rest = camera.state()["current"] - i - math.exp(-1) * (one - i)
    check_mean_and_variance(rest, 0.0, i / (2 * TAU) * (1 - math.exp(-2)))


@pytest.mark.parametrize(
    ("hz", "stop"), [(100_000, 14 * 10**7), (100_000, 26 * 10**7), (5_000, 20 * 10**7)]
)
def test_light_that_changes_inside_a_tick(hz: int, stop: int) -> None:
    # A jump and a bend inside ticks: mean and variance by fine numerical integration. The last
    # case is one tick of two time constants, all of it in parts.
    knots = [
        (0, 4e7, None),
        (123_400_000, 1e7, 9e7),
        (137_900_001, 9e7, 2e7),
        (211_111_111, 5e7, None),
    ]
    given = light(knots, MS, MANY)
    camera = ContinuousCamera(noisy(clock=Clock(hz)))
    camera.step(given, 0, stop)
    gap = 1000
    t = np.arange(0, stop, gap)
    level = np.array([0.0] * len(t))
    for piece in given.pieces:
        own = (t >= piece.start) & (t < piece.stop)
        a, b = (float(current(x)[0, 0]) for x in (piece.first, piece.last))
        level[own] = a + (b - a) * (t[own] + gap / 2 - piece.start) / (piece.stop - piece.start)
    left = (stop - t - gap / 2) * 1e-12 / TAU
    dt = gap * 1e-12 / TAU
    start = float(current(given.pieces[0].first)[0, 0])
    mean = start * math.exp(-stop * 1e-12 / TAU) + float((level * np.exp(-left)).sum()) * dt
    variance = start / (2 * TAU) * math.exp(-2 * stop * 1e-12 / TAU)
    variance += float((level * np.exp(-2 * left)).sum()) * dt / TAU
    check_mean_and_variance(camera.state()["current"], mean, variance)


def test_a_measurement_counts_electrons() -> None:
    # Over T: mean i T, variance i T, covariance with the filtered current i (1 - e^(-T/tau)).
    given = light([(0, 3e7, None)], MS, MANY)
    i = float(current(given.pieces[0].first)[0, 0])
    camera = ContinuousCamera(noisy(measure=3e-4))
    camera.step(given, 0, 21 * 10**7)  # the look at the end of tick 0, then 20 ticks
    state = camera.state()
    t = 2e-4
    check_mean_and_variance(state["charge"], i * t, i * t)
    one, two = state["charge"] - i * t, state["current"] - i
    covariance = i * (1 - math.exp(-t / TAU))
    spread = math.sqrt(covariance**2 + i * t * i / (2 * TAU))
    assert abs((one * two).mean() - covariance) < Z * spread / math.sqrt(one.size)
    reports = camera.step(given, 21 * 10**7, MS)
    assert len(reports) == one.size
    np.testing.assert_array_equal(reports.time, 30)
    check_mean_and_variance(reports.value, i, i / 3e-4)


@pytest.mark.parametrize("bound", [0.5, 1.0, 2.5])
@pytest.mark.parametrize("step", [0.02, 0.001])
def test_a_sampled_monitor_tends_to_siegerts_formula(bound: float, step: float) -> None:
    shifted = exit_time(bound + 0.5826 * math.sqrt(2 * step))
    assert abs(sampled_exit_time(bound, step) / shifted - 1) < 2 * step
    assert sampled_exit_time(bound, step) > exit_time(bound) * (1 + math.sqrt(step))


def test_exit_time_of_a_narrow_and_a_wide_band() -> None:
    # b^2 / 2 without the pull back; sqrt(pi / 2) e^(b^2/2) / b far out (Kramers).
    assert abs(exit_time(0.01) / (0.01**2 / 2) - 1) < 1e-4
    assert abs(exit_time(12.0) / (math.sqrt(math.pi / 2) * math.exp(72) / 12) - 1) < 0.01
    # the figures that docs/continuous.md gives
    figures = [exit_time(3.0), sampled_exit_time(3.0, 0.1), exit_time(5.0)]
    np.testing.assert_allclose(figures, [42.6, 87.0, 7.04e4], rtol=1e-3)
    for bad in (-1.0, 36.0, math.nan):
        with pytest.raises(ValueError, match="bound must"):
            exit_time(bad)
    for bound, step in ((0.0, 0.1), (2.0, 0.0), (2.0, 1e-9), (math.nan, 0.1)):
        with pytest.raises(ValueError, match="bound and step"):
            sampled_exit_time(bound, step)


@pytest.mark.parametrize("bound", [1.0, 2.0])
def test_false_reports_come_as_first_passage_theory_says(bound: float) -> None:
    # All monitors settled on their reference; the mean time to the next report of steady light.
    given = light([(0, 3e7, None)], 2**60, MANY)
    i = float(current(given.pieces[0].first)[0, 0])
    made = noisy(floor=bound * math.sqrt(i / (2 * TAU)))
    camera = ContinuousCamera(made)
    camera.step(given, 0, 10**7)
    state = camera.state()
    state["current"][:], state["reference"][:] = i, i
    camera.restore(state)
    ticks = 1200 if bound > 1 else 250
    reports = camera.step(given, 10**7, ticks * 10**7)
    pixel, place = np.unique(reports.pixel, return_index=True)
    assert pixel.size == MANY[0] * MANY[1]  # each has reported at least once
    waited = reports.time[place] * 0.1  # in time constants
    error = Z * waited.std() / math.sqrt(waited.size)
    assert abs(waited.mean() - sampled_exit_time(bound, 0.1)) < error
    assert error < 0.04 * waited.mean()
    assert abs(waited.mean() - exit_time(bound)) > 5 * error  # what sampling does can be told


def test_the_quiet_floor_is_quiet_from_dark_to_bright() -> None:
    # 5000 pixels from 100 e/s to 1e9 e/s, 200 time constants: a report each, the first.
    shape = (50, 100)
    levels = np.logspace(2, 9, 5000).reshape(shape)
    floor = quiet_floor(0.1, TAU, 9.0)
    given = light([(0, levels, None)], 20 * MS, shape)
    camera = ContinuousCamera(noisy(shape, contrast=0.1, floor=floor))
    assert len(run(camera, given, [0, 20 * MS])) == levels.size
    loud = ContinuousCamera(noisy(shape, contrast=0.1, floor=floor / 9))
    assert len(run(loud, given, [0, 20 * MS])) > 1.2 * levels.size


def wavering(shape: tuple[int, int]) -> Light:
    rng = np.random.default_rng(6)
    starts = [0, *(int(x) for x in np.sort(rng.integers(1, 3 * MS, 14)))]
    knots = [
        (s, 10 ** rng.uniform(5, 8, shape), 10 ** rng.uniform(5, 8, shape) if n % 3 else None)
        for n, s in enumerate(starts)
    ]
    return light(knots, 3 * MS, shape)


@pytest.mark.parametrize("measure", [0.0, 3e-5])
@pytest.mark.parametrize("clock", [CLOCK, Clock(300_000), Clock(29_970)])
def test_splits_tiles_and_restarts_change_nothing(clock: Clock, measure: float) -> None:
    shape = (7, 4)
    given = wavering(shape)
    wanted = noisy(shape, clock=clock, contrast=0.1, floor=1e4, measure=measure)
    whole = run(ContinuousCamera(wanted), given, [0, 3 * MS])
    assert len(whole) > 28 * 10
    bends = [p.start + 7 for p in given.pieces[1:]]  # in the very tick in which pieces meet
    cuts = sorted([*np.random.default_rng(2).integers(1, 3 * MS, 9).tolist(), *bends])
    assert run(ContinuousCamera(wanted), given, [0, *cuts, 3 * MS]) == whole

    parts, camera = [], ContinuousCamera(wanted)
    edges = [0, *cuts, 3 * MS]
    for a, b in pairwise(edges):
        near = Light(tuple(p for p in given.pieces if p.stop > a and p.start < b))
        parts.append(camera.step(near, a, b))
        state, camera = camera.state(), ContinuousCamera(wanted)
        camera.restore(state)
    assert np.array_equal(np.concatenate([p.value for p in parts]), whole.value)

    cut = Light(tuple(Piece(p.start, p.stop, p.first[3:6], p.last[3:6]) for p in given.pieces))
    tile = run(ContinuousCamera(wanted, rows=(3, 6)), cut, [0, 3 * MS])
    own = (whole.row >= 3) & (whole.row < 6)
    np.testing.assert_array_equal(whole.time[own], tile.time)
    np.testing.assert_array_equal(whole.value[own], tile.value)


def test_the_seed_decides_the_noise() -> None:
    given = wavering((3, 3))
    one, two = (noisy((3, 3), seed=seed, contrast=0.1, floor=1e4) for seed in (1, 2))
    first = run(ContinuousCamera(one), given, [0, MS])
    assert run(ContinuousCamera(one), given, [0, MS]) == first
    assert run(ContinuousCamera(two), given, [0, MS]) != first


def test_without_light_there_is_one_report_of_nothing() -> None:
    given = light([(0, 0.0, None)], 5 * MS, (4, 4))
    reports = run(ContinuousCamera(noisy((4, 4), floor=1.0)), given, [0, 5 * MS])
    np.testing.assert_array_equal(intensity_image(reports, 499), 0)
    assert len(reports) == 16


def test_the_first_step_begins_with_a_tick() -> None:
    given = light([(0, 1e6, None)], MS, (1, 1))
    with pytest.raises(ValueError, match="begin with a tick"):
        ContinuousCamera(noisy((1, 1))).step(given, 5, MS)
