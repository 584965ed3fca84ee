"""Flow and tracking by spikes and by frames: closed forms of the scenes, of the filter, and of the
latency of a camera."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from itertools import islice

import cv2
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_discrete_are

from cosim import PS, Block, Clock, InputError
from scenarios.scenes.moving import ExposedSource, Spot, Texture
from scenarios.studies.tracking import Conditions
from scenarios.studies.tracking.conditions import frame_pictures, spike_pictures
from scenarios.studies.tracking.pursuit import (
    RIGHT,
    WARM,
    Background,
    Detection,
    Tracker,
    detect,
    line_gains,
    make_spot,
    pursue,
    steady_gains,
)
from scenarios.studies.tracking.study import make_texture, measure_flow

DARK = Texture((48, 64), level=0.2, swing=0.1, seed=3)
TURNING = Spot(DARK, ((0.002, 10.0, 20.0), (0.006, 40.0, 28.0), (0.009, 44.0, 12.0)))


@pytest.mark.parametrize("span", [(0.0, 0.01), (0.003, 0.0031), (0.0055, 0.0065), (0.0085, 0.02)])
def test_the_mean_of_the_object_is_the_integral_of_its_profile(span) -> None:
    """Also across its appearance, its turn and its disappearance."""
    start, stop = span
    mean, still = TURNING.mean(start, stop), DARK.mean(0, 0)
    inside = [t for t, _, _ in TURNING.knots if start < t < stop]
    for row, column in ((20, 10), (24, 25), (28, 40), (20, 42), (5, 60)):

        def cover(t: float, row: int = row, column: int = column) -> float:
            place = TURNING.position(t)
            if place is None:
                return 0.0
            return math.exp(-((column - place[0]) ** 2 + (row - place[1]) ** 2) / (2 * 2.0**2))

        points = [*inside, *np.linspace(start, stop, 40)[1:-1]]
        share = quad(cover, start, stop, points=points, limit=400)[0] / (stop - start)
        expected = still[row, column] + (1 - still[row, column]) * share
        assert mean[row, column] == pytest.approx(expected, abs=1e-7)


def test_the_mean_of_a_texture_is_the_mean_of_its_instants() -> None:
    texture = Texture((20, 30), velocity=(900.0, -500.0), seed=4)
    # Gauss-Legendre: exact for waves of a few periods
    nodes, weights = np.polynomial.legendre.leggauss(40)
    start, stop = 0.01, 0.035
    times = (start + stop) / 2 + (stop - start) / 2 * nodes
    mean = sum(w / 2 * texture.mean(t, t) for t, w in zip(times, weights, strict=True))
    np.testing.assert_allclose(texture.mean(start, stop), mean, atol=1e-10)
    # It moves: later it is where it was, shifted by the way.
    later = Texture((20, 30), velocity=(1000.0, 2000.0), seed=4)
    now, then = later.mean(0, 0), later.mean(2e-3, 2e-3)
    np.testing.assert_allclose(then[4:, 2:], now[:-4, :-2], atol=1e-12)
    assert 0 <= now.min() < 0.35
    assert 0.65 < now.max() <= 1


@pytest.mark.parametrize("speed", [500.0, 20_000.0, 200_000.0])
def test_the_light_of_a_cycle_is_the_mean_of_the_scene(speed) -> None:
    """In pieces of several cycles, and where the object moves by pixels within a cycle."""
    clock = Clock(40_000)
    spot = Spot(DARK, ((0.0, 5.0, 20.0), (40 / speed, 45.0, 20.0)))
    source = ExposedSource(spot, 700.0, clock)
    light = source.step(None, Block(0, 64))
    for cycle in range(0, 64 - source.every, source.every):
        start, stop = clock.edge(cycle), clock.edge(cycle + source.every)
        exposure = light.integral(start, stop) / 700 / ((stop - start) / PS)
        np.testing.assert_allclose(exposure, spot.mean(start / PS, stop / PS), rtol=1e-6)


def test_frames_have_the_mean_and_the_noise_of_their_electrons() -> None:
    conditions = Conditions(shape=(48, 64))
    still = Texture((48, 64), seed=5)
    frames = [p.values for p in islice(frame_pictures(still, conditions, 1, 1000.0), 400)]
    electrons = still.mean(0, 0) * 0.6 * 1000 * 40_000 / 1000
    scale = np.sqrt(electrons) / electrons * still.mean(0, 0)
    z = (np.mean(frames, axis=0) - still.mean(0, 0)) / scale * math.sqrt(len(frames))
    assert np.abs(z).max() < 5.5  # of 3072 normal numbers
    spread = np.mean(np.var(frames, axis=0, ddof=1) / scale**2)
    assert spread == pytest.approx(1, abs=5 * math.sqrt(2 / 399 / 3072))


def test_the_background_knows_the_noise_of_the_next_difference() -> None:
    """Also from few pictures: z of later differences has the variance 1."""
    random = np.random.default_rng(6)
    pictures = random.normal(0.5, 0.02, (400, 40, 50)).astype(np.float32)
    learned = Background.learn(list(pictures[:6]))
    later = cv2.GaussianBlur(
        pictures[6] - learned.mean, (0, 0), 1.5, borderType=cv2.BORDER_CONSTANT
    )
    assert np.mean((later / learned.noise) ** 2) == pytest.approx(1, abs=0.25)
    assert sum(len(detect(p, learned)) for p in pictures[6:]) == 0
    with pytest.raises(ValueError, match="2 pictures or more, not 1"):
        Background.learn(list(pictures[:1]))


@pytest.mark.parametrize("index", [1e-4, 0.03, 1.0, 3.4])
def test_the_gains_are_those_of_the_kalman_filter(index) -> None:
    """By the algebraic Riccati equation, for unit noise and unit time."""
    step, seen = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    pushed = index**2 * np.outer([0.5, 1.0], [0.5, 1.0])
    ahead = solve_discrete_are(step.T, seen.T, pushed, np.eye(1))
    gain = ahead @ seen.T / (seen @ ahead @ seen.T + 1)
    np.testing.assert_allclose(steady_gains(index), gain[:, 0], rtol=1e-5)


def test_a_new_track_is_the_line_through_its_positions() -> None:
    random = np.random.default_rng(7)
    times, places = np.arange(6) * 1e-3, 20 + 0.3 * np.arange(6) + random.normal(0, 0.02, 6)
    x, v = places[0], 0.0
    for n in range(2, 7):
        alpha, beta = line_gains(n)
        ahead = x + v
        x, v = ahead + alpha * (places[n - 1] - ahead), v + beta * (places[n - 1] - ahead)
    slope, level = np.polyfit(np.arange(6), places, 1)
    assert (x, v) == (pytest.approx(level + 5 * slope), pytest.approx(slope))
    assert times[0] == 0


def test_a_track_of_constant_velocity_has_no_lag_and_ends_without_detections() -> None:
    tracker = Tracker()
    for n in range(50):
        noise_elsewhere = [Detection(60.0, 5.0, 9.0)] if n > 10 else []
        track = tracker.step(n * 1e-3, [*noise_elsewhere, Detection(5 + 0.7 * n, 20.0, 1.0)])
    assert (track.x, track.vx) == (pytest.approx(5 + 0.7 * 49), pytest.approx(700))
    assert track.at(0.1)[0] == pytest.approx(75)
    for n in range(50, 52):
        coasting = tracker.step(n * 1e-3, [])
        assert coasting.x == pytest.approx(5 + 0.7 * n)
    assert tracker.step(0.052, []) is None


QUIET = Conditions(shot_noise=False, frame_rates=(60.0, 240.0, 1000.0))


@pytest.mark.parametrize("speed", [1e3, 1e4, 3e4])
def test_an_object_without_noise_is_tracked_by_spikes(speed) -> None:
    """A count is wrong by less than a spike; 0.3 pixels is twice the error with which the tracker
    reckons."""
    spot = make_spot(QUIET, speed, 0)
    pursuit = pursue(spot, spike_pictures(spot, QUIET, 1))
    assert pursuit.position_px < 0.3
    # lost until its second picture is read, and for as long after the turn at most
    period = QUIET.block / 40_000
    seconds = spot.knots[-1][0] - spot.knots[0][0]
    assert pursuit.lost <= 6 * period / seconds + 1 / 400
    assert pursuit.entry_s <= 2 * period + 1 / 40_000


@pytest.mark.parametrize("rate", [240.0, 1000.0])
def test_an_object_without_noise_is_found_in_frames(rate) -> None:
    """The centroid of a streak is the position at the middle of the exposure."""
    spot = make_spot(QUIET, 1000.0, 1)
    pursuit = pursue(spot, frame_pictures(spot, QUIET, 1, rate))
    assert pursuit.position_px < 0.05


@pytest.mark.parametrize("rate", [60.0, 240.0, 1000.0])
@pytest.mark.parametrize("trial", range(6))
def test_no_camera_responds_sooner_than_its_exposure(rate, trial) -> None:
    """A frame that shows the object is read one exposure after it ends. Where the object is bright
    and slow, it is found in the frame in which it appears or, if that had too little of it or had
    its middle before, in the next."""
    spot = make_spot(QUIET, 300.0, trial)
    pursuit = pursue(spot, frame_pictures(spot, QUIET, 1, rate))
    begin = spot.knots[0][0]
    frame = math.floor(begin * rate)
    possible = [(frame + n + 2) / rate - begin for n in (0, 1)]
    assert any(pursuit.entry_s == pytest.approx(each) for each in possible)
    assert pursuit.entry_s >= 1 / rate
    assert pursuit.turn_s is None or pursuit.turn_s >= 1 / rate


def test_the_object_is_in_the_image_while_it_is_there() -> None:
    conditions = Conditions()
    for trial in range(40):
        for speed in (1e2, 1e4):
            spot = make_spot(conditions, speed, trial)
            assert all(RIGHT < x < 128 - RIGHT and RIGHT < y < 96 - RIGHT for _, x, y in spot.knots)
            assert spot.knots[0][0] >= WARM
            one, two = spot.velocity(0), spot.velocity(1)
            assert one[0] * two[0] + one[1] * two[1] == pytest.approx(0, abs=1e-6 * speed**2)
            assert spot.speed == pytest.approx(speed)


@pytest.mark.parametrize(("speed", "most"), [(1e2, 0.02), (1e3, 0.02), (1e4, 0.05), (3e4, 0.08)])
def test_the_flow_by_spikes_is_that_of_the_texture(speed, most) -> None:
    texture = make_texture(QUIET, speed, 0)
    flow = measure_flow(texture, spike_pictures(texture, QUIET, 1, 4), 512 / 40_000)
    assert flow.error < most * speed
    # the motion between the windows: 8 to 16 pixels, or as much as the longest time has
    assert 8 <= flow.window_s * speed < 17 or flow.window_s * 4 > 0.15
    assert flow.latency_s == pytest.approx(2 * flow.window_s + 1 / 40_000)


def test_frames_miss_a_motion_that_is_longer_than_the_texture() -> None:
    """10 pixels/ms are 167 pixels in a frame of 60 Hz, of which nothing is left, and 10 at 1000."""
    texture = make_texture(QUIET, 1e4, 0)
    slow, fast = (
        measure_flow(texture, frame_pictures(texture, QUIET, 1, rate), 0.01)
        for rate in (60.0, 1000.0)
    )
    assert slow.error > 0.5e4
    assert fast.error < 0.02e4


def test_the_table_the_document_and_the_figure(viform, tmp_path) -> None:
    given = ["compare-tracking", "--speeds", "30,3", "--frame-rates", "1000,240", "--trials", "1"]
    answer = viform(*given, "--figure", tmp_path / "a.png", "--json")
    told = json.loads(answer.out)
    assert [(row["speed_px_ms"], row["camera"]) for row in told["rows"]] == [
        (speed, camera) for speed in (3, 30) for camera in ("spikes", "240 Hz", "1000 Hz")
    ]
    assert told["white_e_s"] == 0.6 * 1000 * 40_000
    spikes, slow, fast = told["rows"][:3]
    assert spikes["entry_ms"] < 1 < fast["entry_ms"] < slow["entry_ms"]
    assert spikes["track_loss"] < fast["track_loss"] < slow["track_loss"] <= 1
    assert cv2.imread(str(tmp_path / "a.png")).shape[2] == 3
    for name in ("entry", "turn"):
        for row in told["rows"]:
            assert (row[f"{name}_ms"] is None) == (row[f"{name}_missed"] > 0.5)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["--speeds", "1,x"], r"--speeds must be numbers with commas between"),
        (["--speeds", "0.001"], r"--speeds must be 0\.01 to 1000 px/ms, not 0\.001"),
        (["--speeds", "1,1"], r"--speeds must be different numbers"),
        (["--frame-rates", "20"], r"--frame-rates must be 30 to 10000 frames/s, not 20"),
        (["--trials", "0"], r"--trials must be 1 to 1000, not 0"),
        (["--white", "nan"], r"--white must be 0\.01 to 1, not nan"),
        (["--figure", "a.jpg"], r"--figure must be a name ending in \.png, not a\.jpg"),
        (["--figure", "none/a.png"], r"--figure must be in a folder that exists"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(refused, given, says) -> None:
    assert re.match(says, refused("compare-tracking", *given))


def test_conditions_are_frozen_and_checked() -> None:
    with pytest.raises(InputError, match="--seed"):
        dataclasses.replace(Conditions(), seed=-1)
