"""Continuous photographing without noise, against closed forms and against a plain stepper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim import Clock, Light, Piece, intensity_image
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.setting import quiet_floor
from sensor.device.pattern import DevicePattern
from tests.sensor.continuous.scene import TAU, current, light, lux, run, setting

SHAPE = (1, 4)
MS = 10**9
TAU_PS = 10**8


@pytest.mark.parametrize("factor", [1.5, 8.0, 0.6, 0.05])
def test_a_step_of_light_is_crossed_at_tau_ln(factor: float) -> None:
    before, after = np.array([[1e5, 1e6, 1e7, 1e8]]), np.array([[1e5, 1e6, 1e7, 1e8]]) * factor
    given = light([(0, before, None), (MS, after, None)], 10 * MS, SHAPE)
    reports = run(ContinuousCamera(setting()), given, [0, 10 * MS])
    i0, i1 = current(lux(before, SHAPE))[0], current(lux(after, SHAPE))[0]
    way = 1.1 if factor > 1 else 0.9
    steps = math.floor(math.log(factor) / math.log(way))
    for column in range(4):
        own = reports.column == column
        n = np.arange(1, steps + 1)
        value = i0[column] * way**n
        # in falling light the floor of 1 e/s never counts: contrast x value is far above it
        due = MS + TAU * 1e12 * np.log((i1[column] - i0[column]) / (i1[column] - value))
        np.testing.assert_array_equal(reports.time[own][0], 0)
        assert own.sum() == steps + 1
        np.testing.assert_allclose(reports.time[own][1:], due, rtol=1e-9)
        np.testing.assert_allclose(reports.value[own][1:], value, rtol=5e-6)


@pytest.mark.parametrize(("first", "last"), [(1e6, 9e6), (9e6, 1e6)])
@pytest.mark.parametrize(("contrast", "floor"), [(0.07, 1.0), (0.0, 3e5)])
def test_a_ramp_is_reported_at_even_steps(
    first: float, last: float, contrast: float, floor: float
) -> None:
    stop = 20 * MS
    given = light([(0, first, last)], stop, (1, 1))
    reports = run(
        ContinuousCamera(setting((1, 1), contrast=contrast, floor=floor)), given, [0, stop]
    )
    i0, i1 = (float(current(lux(x, (1, 1)))[0, 0]) for x in (first, last))
    k = (i1 - i0) / 0.02
    end = i1 - k * TAU * (1 - math.exp(-0.02 / TAU))  # the filtered current at the ramp's end
    if contrast:  # geometric: count ln(end / i0) / ln(1 +- contrast)
        way = 1 + math.copysign(contrast, k)
        count = math.floor(math.log(end / i0) / math.log(way))
        values = i0 * way ** np.arange(count + 1)
    else:  # arithmetic: count |end - i0| / floor
        count = math.floor(abs(end - i0) / floor)
        values = i0 + math.copysign(floor, k) * np.arange(count + 1)
    assert len(reports) == count + 1 >= 20
    np.testing.assert_allclose(reports.value, values, rtol=5e-6)
    t = reports.time * 1e-12
    np.testing.assert_allclose(i0 + k * (t - TAU) + k * TAU * np.exp(-t / TAU), values, rtol=1e-9)


def triangles(shape: tuple[int, int], seed: int, pieces: int = 24) -> Light:
    """Random light: pieces of 10 to 400 us, half of them jump, a third are constant."""
    rng = np.random.default_rng(seed)
    starts = np.cumsum(rng.integers(10, 400, pieces)) * 10**6
    knots, last = [], 10 ** rng.uniform(5, 7, shape)
    for n, start in enumerate([0, *(int(s) for s in starts[:-1])]):
        first = last if n % 2 else 10 ** rng.uniform(5, 7, shape)
        last = None if n % 3 == 0 else 10 ** rng.uniform(5, 7, shape)
        knots.append((start, first, last))
        last = first if last is None else last
    return light(knots, int(starts[-1]), shape)


def filtered(given: Light, h: int) -> np.ndarray:
    """The filtered current of every pixel at multiples of h ps, by the exact step of h."""
    a, seconds = math.exp(-h * 1e-12 / TAU), h * 1e-12
    y = [current(given.at(0)).ravel()]
    for piece in given.pieces:
        steps = (piece.stop - piece.start) // h
        first, last = (current(x).ravel() for x in (piece.first, piece.last))
        k = (last - first) / (steps * seconds)
        for n in range(steps):
            i0 = first + k * (n * seconds)
            y.append(i0 + k * (seconds - TAU) + (y[-1] - i0 + k * TAU) * a)
    return np.array(y)


@pytest.mark.parametrize(("measure", "dead"), [(0.0, 0.0), (3e-5, 0.0), (0.0, 5e-5), (7e-5, 2e-5)])
def test_every_report_is_due_and_none_is_missing(measure: float, dead: float) -> None:
    # The current is stepped by itself every 0.1 us. From where the comparator looks again to where
    # it triggers the current must stay within the threshold, and there it must reach it.
    shape, h = (1, 6), 10**5
    given = triangles(shape, 5)
    stop = given.pieces[-1].stop
    camera = ContinuousCamera(setting(shape, measure=measure, dead_time=dead))
    reports = run(camera, given, [0, stop])
    assert len(reports) > 100
    y, span = filtered(given, h), round(measure * 1e12)
    grid = np.arange(len(y)) * h
    early = 0
    for p in range(6):
        times, values = reports.time[reports.column == p], reports.value[reports.column == p]
        assert times[0] == span
        for n, r in enumerate(values):
            looks = times[n] + max(round(dead * 1e12), 1)
            seen = times[n + 1] - span if n + 1 < len(times) else stop - span
            threshold = max(0.1 * r, 1.0)
            inside = (grid > looks) & (grid < seen)
            assert (abs(y[inside, p] - r) < threshold * (1 + 1e-4)).all()
            if n + 1 == len(times):
                continue
            there = np.interp(seen, grid, y[:, p])
            slack = 2 * abs(np.diff(y[:, p])).max()  # of the interpolation at a jump's corner
            assert abs(there - r) > threshold - slack
            early += seen > looks + 1
            mean = np.interp(seen, grid, y[:, p])
            if span:
                mean = given.integral(int(seen), int(times[n + 1]))[0, p] / measure
                mean *= setting().electrons_per_lux
            assert abs(values[n + 1] - mean) < slack * (not span) + 5e-6 * mean
    assert early > 60  # of them crossings, and not changes that had come in the dead time


def test_the_reports_never_leave_the_current_by_more_than_threshold_and_lag() -> None:
    # |report - y| <= threshold at every instant, and |y - i| <= tau max |di/dt|: a sine in pieces.
    shape, hz, tick = (1, 4), 200.0, 10**6
    mean, swing = np.array([[1e5, 1e6, 3e6, 1e7]]), 0.6
    at = np.arange(0, 10 * MS + 1, 2 * 10**7)
    wave = [mean * (1 + swing * math.sin(2 * math.pi * hz * t * 1e-12)) for t in at]
    given = light(
        [(int(t), a, b) for t, a, b in zip(at, wave, wave[1:], strict=False)], int(at[-1]), shape
    )
    camera = ContinuousCamera(setting(shape, clock=Clock(10**6)))
    reports = run(camera, given, [0, 10 * MS])
    steepest = mean[0] * swing * 2 * math.pi * hz * 1.0001
    worst = 0.0
    for k in range(50, 10_000, 7):
        image = intensity_image(reports, k)[0]
        truth = current(given.at((k + 1) * tick - 1))[0]
        # a report may be as old as its tick: that much the current may have moved since
        bound = 0.1 * image + steepest * (TAU + 1e-6) + 5e-6 * image
        worst = max(worst, float((abs(image - truth) / bound).max()))
    assert 0.8 < worst <= 1  # the bound is met and is not idle


def test_a_measurement_is_the_mean_photocurrent_of_its_time() -> None:
    # A change is seen at tau ln(...); the value then is the new level, without the filter's lag.
    given = light([(0, 1e6, None), (MS, 4e6, None)], 3 * MS, (1, 1))
    camera = ContinuousCamera(setting((1, 1), measure=3e-4))
    reports = run(camera, given, [0, 3 * MS])
    i0, i1 = current(given.pieces[0].first)[0, 0], current(given.pieces[1].first)[0, 0]
    seen = MS + TAU * 1e12 * math.log((i1 - i0) / (i1 - 1.1 * i0))
    np.testing.assert_allclose(reports.time, [3 * TAU_PS, seen + 3 * TAU_PS], rtol=1e-9)
    np.testing.assert_allclose(reports.value, [i0, i1], rtol=5e-6)


def test_one_report_a_tick_and_none_in_the_dead_time() -> None:
    given = light([(0, 1e5, 1e7)], 2 * MS, (1, 2))
    wanted = {"clock": Clock(100_000), "contrast": 0.0}
    fast = run(ContinuousCamera(setting((1, 2), **wanted)), given, [0, 2 * MS])
    assert len(fast) == 2 * 200  # a threshold of 1 e/s: the light outruns every tick
    slow = run(ContinuousCamera(setting((1, 2), **wanted, dead_time=1.05e-4)), given, [0, 2 * MS])
    own = slow.time[slow.column == 0]
    np.testing.assert_array_equal(own, np.arange(20) * 105 // 10)


@pytest.mark.parametrize("clock", [Clock(10**6), Clock(30_000), Clock(2_997_000, 100)])
@pytest.mark.parametrize("measure", [0.0, 4e-5])
def test_splits_and_tiles_change_nothing(clock: Clock, measure: float) -> None:
    shape = (6, 5)
    given = triangles(shape, 7)
    stop = given.pieces[-1].stop
    wanted = setting(shape, clock=clock, measure=measure)
    whole = run(ContinuousCamera(wanted), given, [0, stop])
    cuts = np.sort(np.random.default_rng(3).integers(1, stop, 17)).tolist()
    assert run(ContinuousCamera(wanted), given, [0, *cuts, stop]) == whole
    top = Light(tuple(Piece(p.start, p.stop, p.first[2:5], p.last[2:5]) for p in given.pieces))
    tile = run(ContinuousCamera(wanted, rows=(2, 5)), top, [0, stop])
    own = (whole.row >= 2) & (whole.row < 5)
    np.testing.assert_array_equal(whole.time[own], tile.time)
    np.testing.assert_array_equal(whole.value[own], tile.value)


def test_a_restored_camera_goes_on() -> None:
    shape = (3, 3)
    given = triangles(shape, 8)
    stop, cut = given.pieces[-1].stop, given.pieces[9].start + 12_345_678
    camera = ContinuousCamera(setting(shape, measure=3e-5))
    run(camera, given, [0, cut])
    state = camera.state()
    rest = camera.step(given, cut, stop)
    again = ContinuousCamera(setting(shape, measure=3e-5))
    again.restore(state)
    assert again.step(given, cut, stop) == rest
    assert len(rest) > 50


def test_the_device_scales_light_and_adds_dark_current() -> None:
    shape = (8, 8)
    pattern = DevicePattern(prnu=0.1, dark=1e5, dsnu=0.3, dead=0.1, device_seed=4)
    given = light([(0, 1e6, None)], MS, shape)
    reports = run(ContinuousCamera(setting(shape, pattern=pattern)), given, [0, MS])
    fixed = pattern.at(np.arange(64, dtype=np.uint32))
    wanted = current(given.pieces[0].first).ravel() * fixed.gain + fixed.dark
    np.testing.assert_allclose(intensity_image(reports, 0).ravel(), wanted, rtol=5e-6)
    assert wanted.std() > 1e5


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="threshold_fpn must be 0"):
        setting(pattern=DevicePattern(threshold_fpn=0.01))
    for name, value in (("floor", 0.0), ("time_constant", 0.0), ("contrast", -0.1),
                        ("measure", math.nan), ("dead_time", -1.0), ("seed", 2**32)):  # fmt: skip
        with pytest.raises(ValueError, match=name):
            setting(**{name: value})
    camera, given = ContinuousCamera(setting()), light([(0, 1e6, None)], MS, SHAPE)
    for other in (light([(0, 1e6, None)], MS, (2, 2)), light([(5, 1e6, None)], MS, SHAPE)):
        with pytest.raises(ValueError, match="light must"):
            camera.step(other, 0, MS)
    bad = np.full(SHAPE, np.nan, np.float32)
    with pytest.raises(ValueError, match="finite and 0 or more"):
        camera.step(Light((Piece(0, MS, bad, bad),)), 0, MS)
    camera.step(given, 0, MS // 2)
    with pytest.raises(ValueError, match="go on from"):
        camera.step(given, MS // 2 + 1, MS)


def test_the_quiet_floor_keeps_the_noise_below_the_threshold_at_every_light() -> None:
    made = setting(contrast=0.08, floor=quiet_floor(0.08, TAU, 5.0))
    ratio = [made.threshold(i) / made.shot_noise(i) for i in np.logspace(2, 10, 500)]
    assert min(ratio) >= 5 * (1 - 1e-9)
    assert min(ratio) < 5.1
