"""Motion between frames: closed forms, cuts, what is covered, threads, and a real clip's missing
frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.motion import Between

SHAPE = (96, 128)
RNG = np.random.default_rng(5)
# Waves of 12 to 40 pixels in all directions, so that frames have detail everywhere and a closed
# form at any displacement: the light is 0.5 plus their sum, at most 0.5 in all.
_LENGTH, _ANGLE, _PHASE = RNG.uniform(12, 40, 24), RNG.uniform(0, np.pi, 24), RNG.uniform(0, 7, 24)


def waves(dx: float, dy: float, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """The pattern displaced by dx columns and dy rows, (H, W) float32 in [0, 1]."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    total = np.zeros(shape)
    for length, angle, phase in zip(_LENGTH, _ANGLE, _PHASE, strict=True):
        along = (x - dx) * np.cos(angle) + (y - dy) * np.sin(angle)
        total += np.sin(2 * np.pi * along / length + phase)
    return np.clip(0.5 + 0.06 * total, 0, 1).astype(np.float32)


def noise(seed: int, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """A smooth random texture."""
    rough = np.random.default_rng(seed).random(shape).astype(np.float32)
    smooth = cv2.GaussianBlur(rough, (0, 0), 1.5)
    return np.clip(0.5 + (smooth - 0.5) * 3, 0, 1)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values.astype(float) ** 2)))


@pytest.mark.parametrize("velocity", [(2.3, -1.4), (7.6, 3.3), (0.4, 0.3), (-12.25, 0.0)])
def test_planes_follow_a_pattern_that_moves_by_a_fraction_of_a_pixel(velocity):
    dx, dy = velocity
    between = Between(waves(0, 0), waves(dx, dy))
    assert between.share < 0.02
    assert np.hypot(dx, dy) - 0.5 < between.longest < np.hypot(dx, dy) + 2  # the edges are vague
    # A flow wrong by e pixels displaces the light by at most e / 2 midway, where both frames have
    # it wrong in opposite directions. The gradient of the pattern bounds what a pixel then is off.
    inner = (slice(16, -16), slice(16, -16))
    slope = rms(np.hypot(*np.gradient(waves(0, 0)[inner])))
    for k in range(1, between.planes):
        t = k / between.planes
        true = waves(t * dx, t * dy)[inner]
        error = rms(between.at(k)[inner] - true)
        assert error < 0.06 * slope, k
        linear = rms(between.linear(t)[inner] - true)
        if np.hypot(dx, dy) > 1:
            assert error < 0.2 * linear, k


def test_the_ends_are_the_frames_and_no_motion_is_longer_than_a_pixel_from_plane_to_plane():
    first, last = waves(0, 0), waves(5.3, 2.1)
    between = Between(first, last)
    assert between.at(0) is not between.at(between.planes)
    np.testing.assert_array_equal(between.at(0), first)
    np.testing.assert_array_equal(between.at(between.planes), last)
    assert between.planes % 2 == 0 and between.longest / between.planes <= 1.0


def test_colours_move_as_their_luminance():
    first, last = waves(0, 0), waves(4.2, 0)
    tint = np.array([1.0, 0.5, 0.25], np.float32)
    grey, colour = Between(first, last), Between(first[..., None] * tint, last[..., None] * tint)
    half = colour.at(colour.planes // 2)
    inner = (slice(16, -16), slice(16, -16))
    # Codes of dimmer light are not those of the grey frames: the flow is that of other pictures.
    for channel, share in enumerate(tint):
        np.testing.assert_allclose(
            half[inner][..., channel] / share, grey.at(grey.planes // 2)[inner], atol=0.03
        )


def square(left: int) -> np.ndarray:
    """A textured square of 80 x 80 before another texture at rest, (192, 256)."""
    frame = noise(1, (192, 256))
    frame[56:136, left : left + 80] = noise(2, (192, 256))[:80, :80]
    return frame


def test_what_is_covered_is_interpolated_linearly_and_the_rest_moves():
    between, true = Between(square(60), square(72)), square(66)
    linear = between.linear(0.5)
    light, wrong, _, _ = between._moved(0.5, (0, 192, 0, 256))
    # Midway, 6 columns of the background have just been uncovered, and 6 will be covered.
    hidden = np.zeros(true.shape, bool)
    hidden[56:136, 60:66] = hidden[56:136, 146:152] = True
    assert wrong[hidden].mean() > 0.5
    near = cv2.dilate(hidden.astype(np.uint8), np.ones((17, 17))).astype(bool)
    assert wrong[~near].mean() < 0.005
    assert hidden.mean() / 2 < between.share < 2 * hidden.mean()
    deep = cv2.erode(wrong.astype(np.uint8), np.ones((5, 5))).astype(bool)
    assert deep.any()
    np.testing.assert_allclose(light[deep], linear[deep], atol=1e-6)
    assert between.longest == pytest.approx(12, abs=0.5)
    inside = (slice(70, 120), slice(90, 120))  # the square, away from its edges
    assert rms(light[inside] - true[inside]) < 0.001
    assert rms(light - true) < 0.5 * rms(linear - true)


def test_across_a_cut_light_is_linear():
    between = Between(noise(3), noise(4))
    assert (between.share, between.planes, between.difference) == (1.0, 1, 0.0)


def test_between_equal_frames_nothing_is_drawn():
    frame = noise(3)
    between = Between(frame, frame.copy())
    assert (between.share, between.planes, between.longest) == (0.0, 1, 0.0)


def test_a_change_of_light_without_motion_stays_linear():
    first = noise(3) * np.float32(0.6)
    between = Between(first, first * np.float32(1.2))
    light = between.at(between.planes // 2) if between.planes > 1 else between.linear(0.5)
    np.testing.assert_allclose(light, first * np.float32(1.1), atol=0.01)


def test_a_box_has_the_values_of_the_whole():
    between = Between(square(60), square(69))
    for box in ((0, 1, 0, 1), (140, 141, 70, 71), (191, 192, 255, 256), (20, 170, 3, 90)):
        y0, y1, x0, x1 = box
        for k in (0, 3, between.planes // 2, between.planes):
            part = between.at(k, box)
            assert part.shape == (y1 - y0, x1 - x0)
            np.testing.assert_allclose(part, between.at(k)[y0:y1, x0:x1], atol=2e-6)


def test_the_bits_do_not_depend_on_the_number_of_threads(monkeypatch):
    shape = (300, 420)  # three bands, and several stripes of OpenCV
    frames = noise(5, shape), np.roll(noise(5, shape), (3, 7), (0, 1))
    drawn, before = [], cv2.getNumThreads()
    try:
        for threads in (1, 2, 5):
            cv2.setNumThreads(threads)
            monkeypatch.setattr("scenarios.scenes.clips.motion.cores", lambda n=threads: n)
            between = Between(*frames)
            drawn.append([between.at(k).tobytes() for k in range(between.planes + 1)])
    finally:
        cv2.setNumThreads(before)
    assert len(drawn[0]) > 5
    assert drawn[0] == drawn[1] == drawn[2]


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (8, 100), (100, 8), (33, 500), (500, 2)])
def test_pictures_of_any_shape_have_a_flow(shape):
    # OpenCV's flow refuses below 12 pixels, and at 8 x 100 writes out of bounds.
    frame = np.random.default_rng(0).random(shape).astype(np.float32)
    between = Between(frame, np.roll(frame, 1, axis=1))
    for k in range(between.planes + 1):
        light = between.at(k)
        assert light.shape == shape
        assert light.min() >= 0 and light.max() <= 1


def missing_frames(path: Path, shape: tuple[int, int], step: int) -> np.ndarray:
    """PSNR of every step-th missing frame if each second one is taken away, by motion and by linear
    interpolation, and the share of linear pixels: (n, 3)."""
    clip, rows, n = Clip(path, shape), [], 1
    while True:
        first, true, last = (clip.frame(k) for k in (n - 1, n, n + 1))
        if first is None or true is None or last is None:
            return np.array(rows)
        between = Between(first, last)
        linear = between.linear(0.5)
        light = linear if between.planes == 1 else between.at(between.planes // 2)
        rows.append((-20 * np.log10(rms(light - true)), -20 * np.log10(rms(linear - true)),
                     between.share))  # fmt: skip
        n += step


def test_missing_frames_of_a_real_clip_are_3_db_better_than_linear(shared_data):
    found = missing_frames(shared_data / "bikes.mp4", (272, 640), 6)
    assert len(found) == 42
    assert (found[:, 0] - found[:, 1]).mean() > 3
    assert (found[:, 2] < 1).sum() >= 38  # the clip has a few cuts
    assert 0.02 < found[:, 2].mean() < 0.3
