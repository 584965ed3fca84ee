"""The plan of continuous pixels: the reference beside the camera, what is left out beside what that
changes, and the model's noise beside single electrons."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.special import ndtri

import sensor.continuous.plan as planning
from cosim import Clock, Light
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.core import IntensityCamera
from sensor.continuous.crossing import Reports
from sensor.continuous.plan import SHOT, held_means, law_of
from sensor.continuous.reference import Reference
from sensor.continuous.setting import ContinuousSetting
from tests.sensor.continuous.scene import light, run, setting
from tests.sensor.continuous.test_exact import triangles
from tests.sensor.continuous.test_noise import noisy, wavering

SHAPE = (4, 8)
CURRENT = 2.4e7


def beside(given: ContinuousSetting, falls: Light, edges: Sequence[int]) -> tuple[Reports, Reports]:
    """Reports of the camera and of the reference, by pixel and tick. The reference is saved and
    restored between two steps."""
    seen = run(ContinuousCamera(given), falls, edges)
    numbers = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32)
    reference = Reference(given, numbers)
    for start, stop in itertools.pairwise(edges):
        reference.step(falls, start, stop)
        state, reference = reference.state(), Reference(given, numbers)
        reference.restore(state)
    both = Reports(seen.pixel, seen.time, seen.value), reference.reports()
    orders = [np.lexsort((each.tick, each.pixel)) for each in both]
    one, two = (
        Reports(each.pixel[order], each.tick[order], each.value[order])
        for each, order in zip(both, orders, strict=True)
    )
    return one, two


@pytest.mark.parametrize(("measure", "dead"), [(0.0, 0.0), (3e-5, 5e-5)])
def test_the_reference_finds_the_crossings_of_the_camera(measure: float, dead: float) -> None:
    falls = triangles(SHAPE, 1, 6)
    given = setting(SHAPE, clock=Clock(200_000), measure=measure, dead_time=dead)
    end = given.clock.cycle_at(falls.pieces[-1].stop)
    edges = [0, given.clock.edge(end // 2), given.clock.edge(end)]
    one, two = beside(given, falls, edges)
    assert one.pixel.size > 5 * SHAPE[0] * SHAPE[1]
    assert (one.pixel == two.pixel).all() and (one.tick == two.tick).all()
    np.testing.assert_allclose(one.value, two.value, rtol=1e-5)  # steps of the converter


@pytest.mark.parametrize("measure", [0.0, 2e-5])
def test_the_reference_draws_the_noise_of_the_camera(measure: float) -> None:
    falls = wavering(SHAPE)
    given = noisy(SHAPE, clock=Clock(100_000), measure=measure, contrast=0.1, floor=3e4)
    end = given.clock.cycle_at(falls.pieces[-1].stop)
    edges = [0, given.clock.edge(end // 2), given.clock.edge(end)]
    one, two = beside(given, falls, edges)
    assert one.pixel.size > 10 * SHAPE[0] * SHAPE[1]
    assert (one.pixel == two.pixel).all() and (one.tick == two.tick).all()
    # Straight lines between the quantiles of the table: 3e-5 of a deviation.
    assert np.abs(one.value - two.value).max() < 1e-4 * one.value.mean()


@pytest.mark.parametrize("electrons", [10.0, 25.0, 100.0])
def test_the_noise_is_as_far_from_single_electrons_as_the_expansion_says(electrons: float) -> None:
    """Monitors in steady light, each electron by itself, against normal values of the same rank."""
    random, many, tau = np.random.default_rng(3), 100_000, 250e-6
    given = dataclasses.replace(noisy(SHAPE), time_constant=tau, measure=0.0)
    current = np.zeros(many)
    arrived = random.poisson(15 * electrons, many)  # 15 time constants
    parts = np.exp(-15 * random.random(int(arrived.sum())))
    current = np.add.reduceat(parts, np.concatenate([[0], np.cumsum(arrived)[:-1]]))
    deviation = np.sqrt(electrons / 2)
    assert abs(current.mean() - electrons) < 5 * deviation / np.sqrt(many)
    normal = electrons + deviation * ndtri((np.arange(many) + 0.5) / many)
    distance = np.sqrt(((np.sort(current) - normal) ** 2).mean())
    size, skew, spread = law_of(given, np.array([electrons / tau]))
    assert spread[0] * tau == pytest.approx(deviation)
    # Chance alone puts ranks about 2 deviations / sqrt(many) apart.
    assert distance == pytest.approx(size * tau, rel=0.15, abs=3 * deviation / np.sqrt(many))
    assert distance < size * tau * (1 + skew[0])


def test_a_measurement_is_as_far_from_whole_electrons_as_the_expansion_says() -> None:
    given = noisy(SHAPE, clock=Clock(100_000), measure=2e-4)
    counted = np.sort(np.random.default_rng(4).poisson(60.0, 400_000))
    normal = 60 + np.sqrt(60) * ndtri((np.arange(counted.size) + 0.5) / counted.size)
    distance = np.sqrt(((counted - normal) ** 2).mean())
    assert distance == pytest.approx(law_of(given, np.array([60 / 2e-4]))[0] * 2e-4, rel=0.05)


def test_held_values_are_averaged_over_windows() -> None:
    reports = Reports(np.array([0, 1, 0]), np.array([0, 3, 4]), np.array([2.0, 8.0, 6.0]))
    means = held_means(reports, 3, [(0, 4), (2, 6), (5, 6)])
    np.testing.assert_allclose(means, [[2, 2, 0], [4, 6, 0], [6, 8, 0]])


class _Still:
    """Steady light as a source."""

    notes: tuple[str, ...] = ()
    degraded: tuple[str, ...] = ()

    def __init__(self, stop: int) -> None:
        self._light = light([(0, CURRENT, None)], stop, (32, 32))

    def step(self, data: None, block: object) -> Light:
        return self._light


def _camera(tolerance: float) -> IntensityCamera:
    given = noisy((32, 32), clock=Clock(40_000), time_constant=250e-6, contrast=0.1, floor=7.2e5)
    return IntensityCamera(given, (SHOT, "change threshold"), tolerance=tolerance, floor=1e6)


def _film(camera: IntensityCamera, cycles: int = 200) -> planning.IntensityPlan:
    stop = camera.setting.clock.edge(cycles)
    return camera.plan(_Still(stop).step(None, None), stop)


def test_shot_noise_is_left_out_where_it_is_below_the_tolerance_and_what_that_changes_is_measured():
    """sqrt(1 / 2 i tau) of the current is .0091 at 6000 electrons a time constant."""
    noise = np.sqrt(1 / (2 * CURRENT * 250e-6))
    camera = _camera(4.5 * noise)
    stop = camera.setting.clock.edge(200)
    plan = _film(camera)
    assert plan.plan.left_out == (SHOT,) and plan.kept == ["change threshold"]
    assert plan.absent[0].bound == pytest.approx(2 * noise, rel=1e-6)  # an estimate counts twice
    seen = camera.film(_Still(stop), lambda given: given, 200, check=True)
    assert len(seen) == 32 * 32 and np.ptp(seen.value) == 0
    assert seen.error.of == "run" and seen.error.left_out == {SHOT: plan.absent[0].bound}
    measured = seen.error.measured
    assert measured is not None
    # 256 deviates a tile: the root mean square within 5 / sqrt(2 256) of its expectation.
    assert measured.value == pytest.approx(noise, rel=5 / np.sqrt(512))
    assert _film(_camera(3.5 * noise)).plan.left_out == ()


def test_with_noise_the_error_is_in_law() -> None:
    camera = _camera(1e-3)
    stop = camera.setting.clock.edge(200)
    seen = camera.film(_Still(stop), lambda given: given, 200, check=True)
    error = seen.error
    apart = np.sqrt(2) / (9 * 250e-6) / CURRENT
    assert error.of == "law" and error.law is not None and error.left_out == {}
    assert error.law.mean.value == error.law.variance.value == 0 < error.law.interval_tv.value
    assert error.bound == pytest.approx(apart, rel=0.02)
    assert error.measured is not None
    assert apart < error.measured.value < 1.2 * apart and error.measured.high < 1e-3


def test_noise_whose_absence_changes_more_than_its_bound_comes_back(monkeypatch) -> None:
    real = law_of

    def small(given: ContinuousSetting, mean: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        size, skew, deviation = real(given, mean)
        return size, skew, deviation / 10

    monkeypatch.setattr(planning, "law_of", small)
    camera = _camera(0.01)
    assert _film(camera).plan.left_out == (SHOT,)
    stop = camera.setting.clock.edge(200)
    seen = camera.film(_Still(stop), lambda given: given, 200, check=True)
    assert np.ptp(seen.value) > 0 and seen.error.left_out == {}
    assert any("shot noise kept" in note for note in seen.notes)
    everything = _camera(0.0).film(_Still(stop), lambda given: given, 200)
    assert (seen.value == everything.value).all()


def test_light_that_changes_keeps_shot_noise() -> None:
    camera = _camera(1.0)
    stop = camera.setting.clock.edge(200)
    moving = light([(0, CURRENT, 2 * CURRENT)], stop, (32, 32))
    plan = camera.plan(moving, stop)
    assert plan.plan.left_out == () and np.isinf(plan.rows[0].bound)
