"""Frame panels and the projector against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from display import CameraPlane, FixedEye, PursuingEye
from display.observe.integration import ObserverImages
from display.observe.views import Observer
from display.panels.panel import FramePanel, Projector
from display.references.displays import FrameShow, ProjectorShow

MS = PS // 1000
SIXTY = Clock(60)
SPEED = 4000.0
Show = FrameShow | ProjectorShow


def seen(show: Show, light: Light, until: int, observer: Observer) -> np.ndarray:
    looker = ObserverImages([observer], light.shape)
    for lit in show.step(light, until):
        looker.add(lit)
    return looker.images


def steady(shape: tuple[int, int], level: float = 0.37) -> Light:
    plane = np.full(shape, level * 500, np.float32)
    plane *= np.linspace(0.2, 1, shape[1], dtype=np.float32)
    return Light((Piece(0, 2**62, plane, plane),))


def sliding_edge(frames: int, width: int) -> Light:
    """White to the left of column SPEED t, dark to its right, at each frame's start."""
    pieces = []
    for n in range(frames):
        start, stop = SIXTY.edge(n), SIXTY.edge(n + 1)
        row = np.clip(SPEED * start / PS - np.arange(width), 0, 1).astype(np.float32) * 500
        plane = np.tile(row, (3, 1))
        pieces.append(Piece(start, stop, plane, plane))
    return Light(tuple(pieces))


def width_10_90(profile: np.ndarray) -> float:
    """Pixels from 90 % to 10 % of an edge that falls to the right."""
    column = np.arange(len(profile))
    return float(np.interp(-0.1, -profile, column) - np.interp(-0.9, -profile, column))


@pytest.mark.parametrize("persistence", [1.0, 0.5, 0.1])
def test_an_edge_that_is_pursued_on_a_hold_is_a_ramp(persistence):
    # x + v (t - T) is left of v t_k + x0 for the share of the frame with v u < v T - x.
    frames = 9
    middle = SIXTY.edge(5)
    camera = CameraPlane((middle,), SIXTY.edge(6) - SIXTY.edge(2))
    panel = FramePanel(SIXTY, persistence)
    light = sliding_edge(frames, 700)
    show = FrameShow(panel, light.shape, 500.0)
    image = seen(show, light, SIXTY.edge(frames), PursuingEye(camera, (0.0, SPEED)))[0, 1]
    smear = SPEED / 60 * persistence
    column = np.arange(700) + 0.5  # a column's middle
    place = SPEED * middle / PS
    ramp = np.clip((place - column) / smear, 0, 1)
    inside = slice(190, 520)  # where the whole course of the eye lies on the panel
    # Bilinear shifts and columns of one pixel round the ramp's corners off, over a pixel or so.
    assert np.abs(image - ramp)[inside].max() < 0.6 / smear
    assert width_10_90(image[inside]) == pytest.approx(0.8 * smear, rel=0.02 if smear > 20 else 0.1)


def test_a_still_eye_sees_no_ramp_of_a_hold():
    light = steady((5, 40))
    eye = FixedEye((20 * MS, 45 * MS), 300.0, 0, 64 * MS)
    for panel in (FramePanel(SIXTY), FramePanel(Clock(1000))):
        image = seen(FrameShow(panel, light.shape, 500.0), light, 64 * MS, eye)
        expected = np.broadcast_to(light.pieces[0].first / 500, image.shape)
        np.testing.assert_allclose(image, expected, rtol=2e-6)


@pytest.mark.parametrize("persistence", [0.5, 0.05])
def test_a_strobe_gives_the_light_of_a_hold(persistence):
    light = steady((5, 40))
    camera = CameraPlane((SIXTY.edge(2),), SIXTY.edge(4))
    show = FrameShow(FramePanel(SIXTY, persistence), light.shape, 500.0)
    image = seen(show, light, SIXTY.edge(4), camera)
    np.testing.assert_allclose(image[0], light.pieces[0].first / 500, rtol=1e-6)
    lit = CameraPlane((SIXTY.edge(1) + 2 * MS,), MS // 10)
    dark = CameraPlane((SIXTY.edge(1) + 12 * MS,), MS // 10)
    for camera, factor in ((lit, 1 / persistence if persistence > 0.2 else 0), (dark, 0)):
        show = FrameShow(FramePanel(SIXTY, persistence), light.shape, 500.0)
        image = seen(show, light, SIXTY.edge(4), camera)
        np.testing.assert_allclose(image[0], factor * light.pieces[0].first / 500, atol=1e-6)


def test_slow_pixels_approach_their_level_exponentially():
    response, levels = 4e-3, (0.8, 0.3, 1.0)
    planes = [np.full((2, 3), 500 * level, np.float32) for level in levels]
    edges = [SIXTY.edge(n) for n in range(4)]
    light = Light(
        tuple(Piece(a, b, p, p) for a, b, p in zip(edges, edges[1:], planes, strict=False))
    )
    exposure = MS
    times = tuple(range(MS, 48 * MS, MS))
    show = FrameShow(FramePanel(SIXTY, response=response), (2, 3), 500.0)
    images = seen(show, light, SIXTY.edge(3), CameraPlane(times, exposure))[:, 0, 0]

    def level(t: np.ndarray) -> np.ndarray:
        frame = np.minimum((t * 60).astype(int), 2)
        begin = 0.0
        starts = []
        for target in levels:
            starts.append(begin)
            begin = target + (begin - target) * np.exp(-1 / 60 / response)
        target, first = np.array(levels)[frame], np.array(starts)[frame]
        return target + (first - target) * np.exp(-(t - frame / 60) / response)

    fine = (np.arange(2000) + 0.5) / 2000 - 0.5
    exact = [level(np.array(at / PS) + fine * exposure / PS).mean() for at in times]
    # An exposure cuts a part of a sixteenth of the time constant: at most 1/8 of its change.
    np.testing.assert_allclose(images, exact, atol=2e-3)
    assert np.ptp(images) > 0.6


@pytest.mark.parametrize(
    "panel",
    [
        FramePanel(Clock(10**11), 0.01, 1e-3),  # a frame of 10 ps, a strobe of 0.1
        FramePanel(SIXTY, 1e-15),
        FramePanel(SIXTY, 1.0, 1e-12),
        FramePanel(Clock(3), 1.0, 1e6),
    ],
)
def test_extremes_stay_numbers(panel):
    light = steady((2, 4), 1.0)
    until = min(panel.rate.edge(40), SIXTY.edge(3))  # whole frames
    camera = CameraPlane((until // 2,), until)
    image = seen(FrameShow(panel, (2, 4), 500.0), light, until, camera)[0, :, -1]
    # The slowest has shown nothing yet, all others all.
    slow = panel.response / (until / PS)
    expected = 1 if slow < 1e-6 else 0
    np.testing.assert_allclose(image, expected, atol=1e-4)


def test_latency_is_when_a_frame_comes():
    light = steady((2, 4), 1.0)
    times = (MS, 3 * MS, 30 * MS)
    show = FrameShow(FramePanel(SIXTY, latency=2e-3), (2, 4), 500.0)
    images = seen(show, light, 64 * MS, CameraPlane(times, MS))
    np.testing.assert_allclose(images[:, 0, -1], [0, 1, 1], atol=1e-6)


def test_more_light_than_white_is_white():
    light = steady((2, 4), 3.0)
    for show in (
        FrameShow(FramePanel(Clock(240)), (2, 4), 500.0),
        ProjectorShow(Projector(Clock(16_000)), (2, 4), 500.0),
    ):
        image = seen(show, light, 30 * MS, CameraPlane((15 * MS,), 10 * MS))
        np.testing.assert_allclose(image[0, :, -1], 1.0, rtol=1e-6)


def test_planes_of_the_projector_add_up_to_grey():
    light = steady((30, 40), 0.9)
    rate, planes = Clock(16_000), 200
    late = 80 * PS // 10**6
    camera = CameraPlane((late + rate.edge(planes) // 2,), rate.edge(planes))
    image = seen(ProjectorShow(Projector(rate), (30, 40), 500.0), light, rate.edge(planes), camera)
    error = image[0] - light.pieces[0].first / 500
    # What is carried on never leaves one half to either side: n planes are within 1 / n.
    assert np.abs(error).max() <= 1 / planes + 1e-6
    assert 0.1 / planes < np.abs(error).max()
    assert np.abs(error.mean(axis=0)).max() < 0.5 / planes  # pixels take turns


def test_a_projector_shows_ones_and_zeros_and_follows_ramps():
    rate = Clock(16_000)
    first, last = np.zeros((4, 5), np.float32), np.full((4, 5), 500, np.float32)
    light = Light((Piece(0, rate.edge(320), first, last),))
    show = ProjectorShow(Projector(rate), (4, 5), 500.0)
    planes = np.concatenate([lit.planes.copy() for lit in show.step(light, rate.edge(320))])
    assert planes.shape == (320, 4, 5) and set(np.unique(planes)) == {0, 1}
    level = np.arange(320) / 320
    behind = np.cumsum(planes[:, 2, 3]) - np.cumsum(level)
    assert np.ptp(behind) <= 1 + 1e-4


def pieces_of_noise(clock: Clock) -> list[Piece]:
    rng = np.random.default_rng(8)
    planes = [500 * rng.random((9, 30)).astype(np.float32) for _ in range(65)]
    return [
        Piece(clock.edge(20 * n), clock.edge(20 * n + 20), planes[n], planes[n + 1])
        for n in range(64)
    ]


@pytest.mark.parametrize("kind", ["frames", "slow", "projector"])
def test_blocks_do_not_show(kind):
    clock = Clock(40_000)
    pieces = pieces_of_noise(clock)
    eye = PursuingEye(FixedEye((9 * MS, 20 * MS), 300.0, 0, clock.edge(1280)), (0.0, 900.0))

    def made() -> Show:
        if kind == "projector":
            return ProjectorShow(Projector(Clock(16_000)), (9, 30), 500.0)
        panel = FramePanel(Clock(240), 0.5, 2e-3 if kind == "slow" else 0.0, 1e-3)
        return FrameShow(panel, (9, 30), 500.0)

    def run(size: int, again: bool = False) -> np.ndarray:
        show, looker = made(), ObserverImages([eye], (9, 30))
        for start in range(0, 1280, size):
            stop = min(start + size, 1280)
            light = Light(tuple(pieces[start // 20 : -(-stop // 20)]))
            for lit in show.step(light, clock.edge(stop)):
                looker.add(lit)
            if again:
                before, seen_so_far = show.state(), looker.state()
                show, looker = made(), ObserverImages([eye], (9, 30))
                show.restore(before)
                looker.restore(seen_so_far)
        return looker.images

    whole = run(1280)
    assert whole.max() > 0.2
    np.testing.assert_allclose(run(64), whole, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run(37), whole, rtol=0, atol=1e-6)
    assert np.array_equal(run(64, again=True), run(64))
