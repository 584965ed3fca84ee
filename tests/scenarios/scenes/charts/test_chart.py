"""The chart that slides by: its greys, its speeds, its pictures between two pixels."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import PS, Block, Clock
from display.chain.pursuit import measured_shift, pursuit_of
from scenarios.assemble.schema.loading import load
from scenarios.scenes.charts.chart import DARK, MIDDLE, PURSUIT, SLOW, STRIPS, WEDGE, Chart
from scenarios.scenes.charts.patches import StepSource
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.drawing.analytic import AnalyticSource
from scenarios.scenes.kinds.grid import SceneGrid

SHAPE = (240, 300)
CHART = Chart(SHAPE)
CLOCK = Clock(40_000)


def rows(n: int) -> slice:
    return slice(*(round(part * SHAPE[0]) for part in STRIPS[n][:2]))


def test_a_picture_is_linear_light_and_the_same_every_time():
    one = CHART.reflectance(0.0123)
    assert one.shape == SHAPE and one.dtype == np.float32
    assert one.min() >= 0 and one.max() <= 1 and one.std() > 0.2
    again = CHART.reflectance(0.0123)
    assert again is not one and np.array_equal(one, again)


@pytest.mark.parametrize("shape", [(8, 8), (64, 48), (250, 400), (9, 130)])
def test_any_shape_shows_the_scene(shape):
    chart = Chart(shape)
    picture = chart.reflectance(0.01)
    assert picture.shape == shape and picture.std() > 0.02
    assert picture.min() >= 0 and picture.max() <= 1
    for row, column, label in chart.points():
        assert 0 <= row < shape[0] and 0 <= column < shape[1] and label
    with pytest.raises(ValueError, match="shape must be"):
        Chart((shape[0], 7))
    with pytest.raises(ValueError, match="t must be finite"):
        chart.reflectance(float("nan"))


def test_the_wedge_goes_from_a_spike_in_667_cycles_to_white():
    picture = CHART.reflectance(0.5)
    step = 0.94 * SHAPE[1] / len(WEDGE)
    for n, share in enumerate(WEDGE):
        column = int(0.03 * SHAPE[1] + (n + 0.5) * step)
        assert picture[18, column] == pytest.approx(share / 0.6, rel=1e-6)
    assert picture.max() == 1 and picture[18, int(0.03 * SHAPE[1] + step / 2)] == np.float32(0.0025)


@pytest.mark.parametrize("n", range(len(STRIPS)))
def test_a_strip_slides_a_pixel_in_a_pixels_time_and_comes_round(n):
    speed = STRIPS[n][3]
    one = CHART.reflectance(0.0117)[rows(n)]
    later = CHART.reflectance(0.0117 + 7 / speed)[rows(n)]
    np.testing.assert_allclose(later, np.roll(one, 7, axis=1), atol=2e-6)
    assert np.abs(later - one).max() > 0.2
    round_again = CHART.reflectance(0.0117 + SHAPE[1] / speed)[rows(n)]
    np.testing.assert_allclose(round_again, one, atol=2e-6)


@pytest.mark.parametrize("part", [0.25, 0.61])
def test_between_two_pixels_a_picture_is_the_mean_over_pixels_of_the_strip(part):
    # The light of a row does not change as it slides, and an edge runs linearly in a pixel.
    t = 0.01
    whole, moved = CHART.reflectance(t), CHART.reflectance(t + part / PURSUIT)
    for n in range(4):
        a, b = (p[rows(n)].astype(np.float64).mean(axis=1) for p in (whole, moved))
        np.testing.assert_allclose(a, b, atol=1e-6)
    start = PURSUIT * t + CHART.shape[1] / 4
    at = int(start + part) % CHART.shape[1]
    assert start % CHART.shape[1] == pytest.approx(at, abs=1e-9)  # it begins on a pixel's border
    row = moved[CHART.edge_rows()[0] + 2]
    assert row[at - 1] == pytest.approx(DARK) and row[at + 1] == pytest.approx(MIDDLE)
    assert row[at] == pytest.approx(MIDDLE + (DARK - MIDDLE) * part, abs=1e-5)


def test_nothing_changes_outside_the_moving_box():
    for start, stop in ((0.0, 25e-6), (0.03, 0.031)):
        y0, y1, x0, x1 = CHART.moving(start, stop)
        change = CHART.reflectance(stop) != CHART.reflectance(start)
        assert change[y0:y1, x0:x1].any(axis=1).sum() > 0.5 * (y1 - y0)
        change[y0:y1, x0:x1] = False
        assert not change.any() and y0 > SHAPE[0] // 4
    assert CHART.moving(0.1, 0.1) == (0, 0, 0, 0)


def test_a_finer_grid_shows_the_same_light():
    fine = Chart((800, 800)).reflectance(0.0).astype(np.float64)
    mean = fine.reshape(400, 2, 400, 2).mean(axis=(1, 3))
    coarse = Chart((400, 400)).reflectance(0.0)  # whose strips, too, end on whole rows
    still = np.r_[0:72, 110:400]  # but for the lines, which begin on a whole pixel
    assert np.sqrt(np.mean((mean - coarse)[still] ** 2)) < 0.02
    assert abs(mean.mean() - coarse.mean()) < 0.004


def test_the_front_door_is_this_chart():
    _, scenario = load("glass")
    assert scenario.display is not None and scenario.display.drive == "causal"
    source = scenario.scene.source(SceneGrid((40, 50), CLOCK, 2560))
    assert isinstance(source, AnalyticSource) and source.pursuit == PURSUIT
    light = source.step(None, Block(0, 64))
    assert np.array_equal(light.at(0), Chart((40, 50)).reflectance(0.0) * np.float32(700))
    _, film = load("film")
    other = film.scene.source(SceneGrid((40, 50), CLOCK, 2560))
    assert isinstance(other, AnalyticSource) and other.pursuit == PURSUIT


def test_a_scene_that_says_nothing_is_measured():
    source = AnalyticSource(Chart((400, 500)), 700.0, CLOCK)
    speed, note = pursuit_of(source, CLOCK.edge(2560))
    assert speed == PURSUIT and "the speed of the scene" in note
    source.pursuit = None
    speed, note = pursuit_of(source, CLOCK.edge(2560))
    assert speed == pytest.approx(PURSUIT, rel=0.02)
    assert f"{speed:.4g} pixels/s, measured" in note
    assert SLOW < PURSUIT


def test_an_eye_keeps_still_where_nothing_moves(tmp_path, make_clip):
    step = StepSource((64, 80), 700.0, 0.1, 0.9, 0.0, CLOCK.edge(100))
    assert pursuit_of(step, CLOCK.edge(100)) == (
        0.0, "the pursuing eye does not move: the scene has no motion along the rows"
    )  # fmt: skip
    assert measured_shift(np.zeros((9, 9), np.float32), np.zeros((9, 9), np.float32)) is None


@pytest.mark.parametrize("speed", [-2, 3])
def test_a_clip_is_measured_in_pixels_a_second(tmp_path, make_clip, speed):
    noise = np.random.default_rng(3).integers(0, 255, (24, 300)).astype(np.uint8)
    still = np.repeat(np.repeat(noise, 8, axis=0), 4, axis=1)[:, :640]
    frames = np.stack([np.roll(still, speed * n, axis=1)[:, 200:400] for n in range(30)])
    clip = make_clip(tmp_path / "a.mkv", frames)
    source = FilmSource(clip, (192, 200), 500.0, CLOCK, 20_000, rate=200.0)
    found, _ = pursuit_of(source, 120 * PS // 1000)
    assert found == pytest.approx(speed * 200, rel=0.05)
