"""The shock wave's scene: gas dynamics against tables and conservation laws, the picture against
gas dynamics, and its light against a much finer drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim import PS, Block, Clock, InputError
from scenarios.assemble.schema.loading import load
from scenarios.scenes.drawing.paced import PARTS, PacedSource
from scenarios.scenes.flow import shockwave as module
from scenarios.scenes.flow.gasdynamics import (
    GAMMA,
    Gas,
    behind_normal,
    behind_oblique,
    billig_standoff,
    detachment,
    fan,
    nozzle,
    prandtl_meyer,
    reflected,
    shock_angle,
    shock_mach,
    stagnation_ratio,
    stalling,
    start_flow,
)
from scenarios.scenes.flow.shockwave import Shockwave
from scenarios.scenes.flow.sightlines import GLADSTONE_DALE, OPEN, RANGE, WIDTH, Bench
from scenarios.scenes.flow.steadyflow import Sphere, Wedge, _layer_density
from scenarios.scenes.kinds.grid import SceneGrid

CLOCK = Clock(40_000)
SHAPE = (250, 400)
SMALL = (50, 80)
STEADY = 0.012
deg = math.radians


@pytest.fixture(scope="module")
def wedge() -> Shockwave:
    return Shockwave(SHAPE, knife=0.0)


@pytest.fixture(scope="module")
def sphere() -> Shockwave:
    return Shockwave((200, 260), model="sphere", radius=0.015, knife=0.0)


# Gas dynamics.


@pytest.mark.parametrize(
    ("mach", "p", "rho", "temperature", "after"),
    [  # NACA Report 1135, table II
        (1.5, 2.458, 1.862, 1.320, 0.7011),
        (2.0, 4.500, 2.667, 1.687, 0.5774),
        (6.0, 41.83, 5.268, 7.941, 0.4042),
    ],
)
def test_normal_shocks_are_those_of_the_tables(mach, p, rho, temperature, after):
    assert behind_normal(mach) == pytest.approx((p, rho, temperature, after), rel=3e-4)


@pytest.mark.parametrize(
    ("mach", "turn", "beta"),
    [(2.0, 10.0, 39.31), (3.0, 20.0, 37.76), (5.0, 20.0, 29.80), (2.0, 0.0, 30.0)],
)
def test_oblique_shocks_stand_at_the_published_angles(mach, turn, beta):
    assert math.degrees(shock_angle(mach, deg(turn))) == pytest.approx(beta, abs=0.006)


@pytest.mark.parametrize(("mach", "nu", "ratio"), [(2.0, 26.38, 7.824), (6.0, 84.96, 1579.0)])
def test_expansions_are_those_of_the_tables(mach, nu, ratio):
    assert math.degrees(prandtl_meyer(mach)) == pytest.approx(nu, abs=0.006)
    assert stagnation_ratio(mach) ** 3.5 == pytest.approx(ratio, rel=2e-4)
    waves = fan(mach, 0.3, 0.1)
    assert waves.direction[-1] == pytest.approx(0.2)
    # Isentropic: p = rho^gamma, T = p/rho, stagnation temperature kept.
    heat = waves.density ** (GAMMA - 1) * stagnation_ratio(waves.mach)
    np.testing.assert_allclose(heat, stagnation_ratio(mach), rtol=1e-12)
    np.testing.assert_allclose(np.sin(waves.angle - waves.direction) * waves.mach, 1.0, rtol=1e-12)


def test_the_flow_is_sonic_where_the_shock_is_said_to_detach():
    for mach in (1.5, 3.0, 6.0):
        turn, beta = detachment(mach)
        assert behind_oblique(mach, beta, turn)[2] == pytest.approx(1.0, abs=1e-9)
        assert shock_angle(mach, turn) == pytest.approx(beta)
        with pytest.raises(ValueError, match=r"deflection must be 0 to [\d.]+ deg"):
            shock_angle(mach, turn + 1e-6)


def flux(gas: Gas, speed: float) -> tuple[float, float, float]:
    """Mass, momentum and energy that cross a front at `speed`."""
    u = gas.velocity - speed
    heat = GAMMA / (GAMMA - 1) * gas.pressure / gas.density
    return gas.density * u, gas.pressure + gas.density * u * u, heat + 0.5 * u * u


@pytest.mark.parametrize("ratio", [1.001, 3.0, 40.0])
@pytest.mark.parametrize("gamma", [1.4, 5 / 3])
def test_a_shock_thrown_back_from_a_wall_leaves_the_gas_at_rest(monkeypatch, ratio, gamma):
    monkeypatch.setattr("scenarios.scenes.flow.gasdynamics.GAMMA", gamma)

    def kick(ratio: float) -> float:
        """Velocity that a shock gives, in sounds of the gas before it, by continuity."""
        mach = shock_mach(ratio)
        assert behind_normal(mach)[0] == pytest.approx(ratio)
        return mach * (1 - 1 / behind_normal(mach)[1])

    sound = math.sqrt(behind_normal(shock_mach(ratio))[2])
    assert sound * kick(reflected(ratio)) == pytest.approx(kick(ratio), rel=1e-9)


def test_just_behind_a_bow_shock_s_nose_the_density_is_rankine_hugoniot_s_of_any_gas(monkeypatch):
    for gamma in (1.4, 5 / 3):
        monkeypatch.setattr("scenarios.scenes.flow.gasdynamics.GAMMA", gamma)
        rest = (9.0, 40.0, 1.0, (0.0,) * 6, np.zeros(2), np.ones(2))
        shock = (0.01, 0.002, 0.015, 0.2)
        rho = _layer_density(-0.002 + 1e-12, 0.0, *shock, gamma, 6.0, *rest)
        assert rho == pytest.approx(behind_normal(6.0)[1], rel=1e-8)


@pytest.mark.parametrize("share", [0.3, 0.85, 0.99])
def test_mass_momentum_and_energy_cross_both_shocks_of_the_start(share):
    stream = nozzle(6.0, 1e6, 500.0)
    assert stream.mach == pytest.approx(6.0)
    assert stream.temperature == pytest.approx(500 / 8.2)
    stall = stalling(stream, 293.0)
    waves = start_flow(stream, share * stall, 293.0)
    assert flux(waves.flow, waves.starting) == pytest.approx(flux(waves.cold, waves.starting))
    assert flux(waves.rest, waves.primary) == pytest.approx(flux(waves.hot, waves.primary))
    assert (waves.cold.pressure, waves.cold.velocity) == (waves.hot.pressure, waves.hot.velocity)
    assert 0 < waves.starting < waves.cold.velocity < waves.primary
    assert abs(start_flow(stream, stall * (1 - 1e-9), 293.0).starting) < 1e-4
    with pytest.raises(ValueError, match="the chamber must be at 633 to 13324 Pa, not 13457"):
        start_flow(stream, 1.01 * stall, 293.0)


def test_the_fan_bends_the_shock_towards_the_mach_angle():
    body = Wedge(nozzle(6.0, 1e6, 500.0), deg(15), 0.03, 0.01)
    xs, ys = body.shock
    slopes = np.arctan2(np.diff(ys), np.diff(xs))
    assert slopes[0] == pytest.approx(body.beta)
    # As printed (here between the fan's first ray and the shock, from the law of sines).
    ray = body.shoulder.angle[0]
    x = 0.03 * (math.tan(ray) - math.tan(deg(15))) / (math.tan(ray) - math.tan(body.beta))
    assert xs[1] == pytest.approx(x)
    assert np.all(np.diff(slopes) <= 0) and slopes[-1] >= math.asin(1 / 6) - 1e-9
    # Just behind the shock and well above the wall: the jump of theta-beta-M.
    inside = body.density(np.array(0.02), np.array(0.02 * math.tan(body.beta) - 1e-4))
    assert inside == pytest.approx(body.behind[1])


def test_a_bow_shock_has_billigs_standoff_curvature_and_far_angle():
    body = Sphere(nozzle(6.0, 1e6, 500.0), 0.01, 0.02)
    assert body.standoff == pytest.approx(0.01 * 0.143 * math.exp(3.24 / 36))
    y = 1e-5
    bend = (body.front(np.array(y)) - body.front(np.array(0.0))) * 2 / y**2
    assert 1 / bend == pytest.approx(0.01 * 1.143 * math.exp(0.54 / 5**1.2), rel=1e-4)
    far = body.front(np.array([10.0, 11.0]))
    assert math.atan2(1.0, far[1] - far[0]) == pytest.approx(math.asin(1 / 6), rel=1e-3)
    # On the axis, from the shock to the stagnation point, the layer is as dense as the normal
    # shock makes it, and denser at the wall: Rayleigh's pitot formula (NACA 1135, table II: 46.82).
    assert body.stagnation[1] == pytest.approx(46.82, rel=2e-4)
    assert body.stagnation[0] > behind_normal(6.0)[1]


# The picture.


def test_a_schlieren_bench_darkens_by_the_gradient():
    for knife in (0.0, 0.5, 0.5 * math.pi):
        bench = Bench.build((40, 60), 1e-3, knife, np.zeros((40, 60), np.float32))
        y, x = np.mgrid[:40, :60].astype(np.float32) * 1e-3
        slope = 0.4 * RANGE / GLADSTONE_DALE
        for path, part in ((slope * x, math.cos(knife)), (slope * y, math.sin(knife))):
            inner = bench.picture(path)[1:-1, 1:-1] / np.maximum(bench.lamp[1:-1, 1:-1], 1e-9)
            lit = bench.lamp[1:-1, 1:-1] > 0.5
            np.testing.assert_allclose(inner[lit], OPEN - 0.5 * 0.4 * part, atol=2e-4)


def dark_column(picture: np.ndarray, row: int, lamp: np.ndarray, first: int, stop: int) -> float:
    """Centre of what is darker than half of the undeflected light, columns, within first..stop."""
    line = 1 - picture[row] / np.maximum(OPEN * lamp[row], 1e-6)
    weight = np.clip(line[first:stop], 0.5, 1) - 0.5
    return float(np.sum(weight * (np.arange(first, stop) + 0.5)) / weight.sum())


def test_the_shock_in_the_picture_stands_at_the_angle_of_theta_beta_m(wedge):
    picture, lamp = wedge.reflectance(STEADY), module._parts(wedge).bench.lamp
    view = wedge.view
    tip = 0.5 * SHAPE[1] + wedge.nose / view.pixel
    # Rows that the shock crosses after the nose and before the fan meets it.
    far = wedge.body.shock[1][1] / view.pixel
    rows = np.arange(10, int(far) - 3)
    columns = []
    for up in rows:
        at = tip + up / math.tan(wedge.body.beta)
        columns.append(dark_column(picture, SHAPE[0] // 2 - 1 - up, lamp, int(at) - 6, int(at) + 9))
    slope = np.polyfit(columns, rows + 0.5, 1)[0]
    # A centre is right to half a pixel across the shock; over this base that is:
    tolerance = 0.5 / math.hypot(rows[-1] - rows[0], columns[-1] - columns[0])
    assert len(rows) > 60
    assert math.atan(slope) == pytest.approx(wedge.body.beta, abs=tolerance)


def test_the_bow_shock_in_the_picture_stands_off_as_billig_says(sphere):
    view, picture = sphere.view, sphere.reflectance(STEADY)
    tip = 0.5 * 260 + sphere.nose / view.pixel
    row = picture[100] / (OPEN * module._parts(sphere).bench.lamp[100])
    first = int(np.flatnonzero(row[: int(tip)] < 0.9)[0])
    pixels = 0.015 * billig_standoff(6.0) / view.pixel
    assert pixels > 7
    # Sobel's kernel reaches a pixel ahead; the edge falls anywhere in its pixel.
    assert tip - first == pytest.approx(pixels, abs=1.5)


def test_a_settling_bow_shock_follows_the_starting_shock_and_never_passes_it(sphere):
    times = np.linspace(sphere.start, 0.01, 400)
    swells = np.array([sphere.swell(t) for t in times])
    ahead = np.array([sphere.nose - sphere.place(t, sphere.waves.starting) for t in times])
    stand = swells * sphere.body.standoff
    assert np.all(np.diff(swells) <= 0) and swells[-1] == 1.0
    assert np.all(stand >= ahead - 1e-9)
    before = ahead > 6 * sphere._way
    assert before.sum() > 10
    np.testing.assert_allclose(stand[before], ahead[before], rtol=0.02)


def test_the_shocks_cross_the_picture_at_the_speed_of_rankine_and_hugoniot(wedge):
    waves, view = wedge.waves, wedge.view
    row = 20
    for speed, t0, gap, sign in (
        (waves.primary, 2.08e-3, 80e-6, -1.0), (waves.starting, 3.0e-3, 1.5e-3, 1.0),
    ):  # fmt: skip
        places = []
        for t in (t0, t0 + gap):
            path = wedge.path(t)[row].astype(np.float64)
            change = np.clip(sign * np.diff(path), 0, None) ** 2
            expected = (wedge.place(t, speed) - wedge.left) / view.pixel
            near = np.abs(np.arange(1, SHAPE[1]) - expected) < 12
            places.append(
                float(np.sum((change * np.arange(1, SHAPE[1]))[near]) / change[near].sum())
            )
        moved = (places[1] - places[0]) * view.pixel / gap
        assert moved == pytest.approx(speed, abs=1.0 * view.pixel / gap)


def test_the_density_jumps_in_the_picture_as_rankine_and_hugoniot_say(wedge):
    waves, view = wedge.waves, wedge.view
    t, row = 2.09e-3, 3
    column = int((wedge.place(t, waves.primary) - wedge.left) / view.pixel)
    line = wedge.path(t)[row] / WIDTH
    mach = waves.primary / waves.rest.sound
    far = line[column + 20]
    assert far == pytest.approx(waves.rest.density, rel=1e-6)
    # The gas has begun to give way to the model: a per cent or two off the wedge.
    assert line[column - 6] / far == pytest.approx(behind_normal(mach)[1], rel=0.03)
    t = 3.0e-3
    column = int((wedge.place(t, waves.starting) - wedge.left) / view.pixel)
    line = wedge.path(t)[row] / WIDTH
    against = (waves.flow.velocity - waves.starting) / waves.flow.sound
    assert line[column - 4] == pytest.approx(waves.flow.density, rel=1e-6)
    assert line[column + 6] / line[column - 4] == pytest.approx(behind_normal(against)[1], rel=0.05)


@pytest.mark.parametrize("model", ["wedge", "sphere"])
@pytest.mark.parametrize("shape", [(8, 8), (50, 80), (64, 48), (9, 130)])
def test_any_shape_is_a_picture_the_same_every_time(model, shape):
    scene = Shockwave(shape, model=model)
    for t in (0.0, 0.0021, 0.0035, 0.02):
        one = scene.reflectance(t)
        assert one.shape == shape and one.dtype == np.float32
        assert one.min() >= 0 and one.max() <= 1
        assert np.array_equal(one, scene.reflectance(t))
    module._parts.cache_clear()
    assert np.array_equal(one, scene.reflectance(t))
    for row, column, label in scene.points():
        assert 0 <= row < shape[0] and 0 <= column < shape[1] and label


@pytest.mark.parametrize("model", ["wedge", "sphere"])
def test_nothing_changes_outside_the_moving_box_nor_between_episodes(model):
    scene = Shockwave(SMALL, model=model)
    first, last = scene.episodes()[0][0], scene.episodes()[-1][1]
    for a, b in ((0.0, first), (last, 0.1), (last, 5.0)):
        assert scene.moving(a, b) == (0, 0, 0, 0)
        picture = scene.reflectance(a)
        for t in np.linspace(a, b, 7):
            assert np.abs(scene.reflectance(t) - picture).max() < 2e-3
    for start, span in ((first, 25e-6), (0.0021, 1e-4), (0.003, 25e-6), (0.0045, 1e-3)):
        y0, y1, x0, x1 = scene.moving(start, start + span)
        before = scene.reflectance(start)
        changed = np.zeros(SMALL, bool)
        for part in np.linspace(0.1, 1.0, 9):
            changed |= np.abs(scene.reflectance(start + part * span) - before) > 2e-4
        assert changed[y0:y1, x0:x1].sum() == changed.sum() > 0


def test_bad_instants_are_refused(wedge):
    with pytest.raises(ValueError, match="t must be finite"):
        wedge.reflectance(math.nan)
    with pytest.raises(ValueError, match=r"stop must be at or after start 1\.0, not 0\.0"):
        wedge.moving(1.0, 0.0)


# Its light.


@pytest.mark.parametrize("cycle", [83, 95, 120])
def test_a_cycles_light_is_that_of_a_finer_drawing(cycle):
    scene = Shockwave(SMALL)
    source = PacedSource(scene, 100.0, CLOCK)
    start, stop = CLOCK.edge(cycle), CLOCK.edge(cycle + 1)
    given = source.step(None, Block(cycle, 1)).integral(start, stop)
    n = source._steps[cycle]
    m = 64 * n
    times = (start + (stop - start) * (np.arange(m + 1)) / m) / PS
    planes = np.stack([scene.reflectance(t) for t in times]).astype(np.float64) * 100
    finer = np.trapezoid(planes, times, axis=0)
    variation = np.abs(np.diff(planes, axis=0)).sum(axis=0)
    seconds = (stop - start) / PS
    # The bound of the docstring, of both drawings, and float32's rounding.
    bound = variation * seconds * (0.5 / n + 0.5 / m) + 2e-6 * 100 * seconds
    error = np.abs(given - finer)
    assert np.all(error <= bound)
    assert variation.max() > 20  # an edge did pass
    assert error.mean() < 5e-3 * 100 * seconds  # measured 3.4e-3 where one step does a cycle


@pytest.mark.parametrize("share", [0.3, 0.5])
@pytest.mark.parametrize("cycle", [83, 95, 120])
def test_a_window_that_cuts_cycles_sees_the_light_of_a_finer_drawing(cycle, share):
    scene = Shockwave(SMALL)
    source, whole = PacedSource(scene, 100.0, CLOCK, False), PacedSource(scene, 100.0, CLOCK)
    start, middle, stop = (CLOCK.edge(cycle + k) for k in range(3))
    late = round(share * (middle - start))
    window = start + late, middle + late
    m = 1024
    times = (start + (stop - start) * np.arange(m + 1) / m) / PS
    planes = np.stack([scene.reflectance(t) for t in times]).astype(np.float64) * 100
    inside = (times >= window[0] / PS - 1e-12) & (times <= window[1] / PS + 1e-12)
    finer = np.trapezoid(planes[inside], times[inside], axis=0)
    finer *= (window[1] - window[0]) / PS / (times[inside][-1] - times[inside][0])
    variation = np.abs(np.diff(planes, axis=0)).sum(axis=0)
    seconds, n = (middle - start) / PS, min(source._steps[c] for c in (cycle, cycle + 1))
    bound = variation * seconds * (0.5 / n + 0.25 / PARTS + 4 / m) + 2e-6 * 100 * seconds
    block = Block(cycle, 2)
    error = np.abs(source.step(None, block).integral(*window) - finer)
    assert np.all(error <= bound)
    # One mean a cycle is worse by far where a cycle takes many pictures.
    single = np.abs(whole.step(None, block).integral(*window) - finer)
    assert n <= PARTS or np.sqrt((error**2).mean()) < 0.5 * np.sqrt((single**2).mean())


@pytest.mark.parametrize("aligned", [True, False])
def test_light_does_not_depend_on_how_a_run_is_split(aligned):
    scene = Shockwave(SMALL)
    whole = PacedSource(scene, 50.0, CLOCK, aligned).step(None, Block(0, 320))
    source = PacedSource(scene, 50.0, CLOCK, aligned)
    for start, cycles in ((0, 64), (64, 30), (94, 100), (194, 126)):
        light = source.step(None, Block(start, cycles))
        for cycle in (start, start + cycles // 2, start + cycles - 1):
            span = CLOCK.edge(cycle), CLOCK.edge(cycle + 1)
            np.testing.assert_array_equal(light.integral(*span), whole.integral(*span))
    late = PacedSource(scene, 50.0, CLOCK, aligned).step(None, Block(310, 4))
    assert np.array_equal(late.at(CLOCK.edge(312)), whole.at(CLOCK.edge(312)))


@pytest.mark.parametrize("aligned", [True, False])
def test_a_cycle_of_a_thousand_seconds_is_drawn_where_the_scene_moves(aligned):
    scene = Shockwave(SMALL)
    stop = 1000 * PS
    long = PacedSource(scene, 100.0, Clock(1, 1000), aligned)
    pictures = sum(PacedSource(scene, 100.0, CLOCK)._steps.values())
    assert sum(long._steps.values()) <= pictures + 10
    last = CLOCK.cycle_at(round(scene.episodes()[-1][1] * PS)) + 1
    settled = CLOCK.edge(last)
    moving = PacedSource(scene, 100.0, CLOCK).step(None, Block(0, last)).integral(0, settled)
    still = scene.reflectance(1000.0).astype(np.float64) * 100 * (stop - settled) / PS
    given = long.step(None, Block(0, 1)).integral(0, stop)
    np.testing.assert_allclose(given, moving + still, rtol=2e-6, atol=1e-4)


# The scenario.


def made(*assignments: str):
    _, scenario = load("shockwave", list(assignments))
    cycles = CLOCK.cycles_in(round(scenario.duration * PS))
    return scenario.scene.source(SceneGrid(SMALL, CLOCK, cycles))


def test_the_scenario_makes_a_source_that_says_how_it_is_drawn():
    source = made()
    assert "moves from cycle 81 to" in source.notes[0] and source.degraded == []
    assert source.truth(0).shape == SMALL
    assert made("duration=3 ms").degraded == [
        "the run ends before the flow is steady: lengthen duration"
    ]


@pytest.mark.parametrize(
    ("assignments", "says"),
    [
        (("scene.angle=44 deg",), "scene.angle must be 2 to 42.43 deg, where the shock at Mach 6 "
         "is attached and the flow behind it supersonic, not 44; write a value of these"),
        (("scene.mach=4.5", "scene.angle=41 deg"), "scene.angle must be 2 to 40.11 deg"),
        (("scene.chamber=50 kPa",), "scene.chamber must be 5996 to 12657 Pa at Mach 6, where the "
         "tunnel starts with two shocks, not 50000; write a value of these"),
        (("scene.mach=9",), "scene.mach must be "),
        (("scene.angle=15 mm",), "scene.angle must be an angle such as '15 deg'"),
        (("scene.chamber=9 V",), "scene.chamber must be a pressure such as '9 kPa'"),
        (("scene.model=cone",), "scene.model must be 'wedge' or 'sphere', not 'cone'"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(assignments, says):
    with pytest.raises(InputError) as refused:
        made(*assignments)
    assert str(refused.value).startswith(says)
    assert "\n" not in str(refused.value)
