"""Motion-aligned TFP on patterns whose motion is known, and what becomes of what has no match."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock, InputError, Viform
from sensor import tfp
from sensor.reconstruct import METHODS, reconstruct
from sensor.reconstruct.fidelity import psnr
from sensor.reconstruct.motion import LEAST, motion_tfp

CLOCK = Clock(40_000)
CYCLES, AT = 401, 200


def spikes_of(light: np.ndarray) -> Viform:
    """Ideal pixels without noise: (T, H, W) thresholds a cycle, residual carried, any phase."""
    phase = np.random.default_rng(1).random(light.shape[1:])
    charge = np.floor(np.cumsum(light, axis=0) + phase)
    return Viform.from_planes(np.diff(charge, axis=0, prepend=0) > 0, CLOCK)


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Light in spikes a cycle, 0.02 to 0.48."""
    waves = sum(np.sin(u * x + v * y) for u, v in ((0.5, 0.2), (0.24, -0.43), (0.11, 0.31)))
    return 0.25 + 0.23 / 3 * np.asarray(waves)


def moving(speed: tuple[float, float], shape: tuple[int, int] = (48, 64)) -> np.ndarray:
    """The pattern in motion. speed: columns and rows a cycle."""
    y, x = np.indices(shape, float)
    times = np.arange(CYCLES) - AT
    return np.stack([pattern(x - speed[0] * t, y - speed[1] * t) for t in times])


@pytest.mark.parametrize("speed", [(0.06, 0.0), (-0.04, 0.05), (0.0, -0.1)])
def test_the_window_follows_a_known_motion(speed: tuple[float, float]) -> None:
    light = moving(speed)
    stream, truth = spikes_of(light), light[AT].astype(np.float32)
    found = motion_tfp(stream, AT, 121)
    best = max(psnr(tfp(stream, AT, w).astype(float), truth) for w in range(3, 200, 4))
    assert psnr(found.rate.astype(float), truth) > best + 3
    assert found.plain.mean() < 0.1


def test_what_does_not_move_is_the_mean_of_the_same_cycles() -> None:
    stream = spikes_of(np.full((CYCLES, 16, 20), 0.31))
    same = Viform(
        np.broadcast_to(stream.words[:, :1, :1], stream.words.shape).copy(), CYCLES, CLOCK
    )
    found = motion_tfp(same, AT, 99)  # 33 parts of 3 cycles
    np.testing.assert_allclose(found.rate, tfp(same, AT, 99), atol=1e-6)
    assert not found.plain.any() and not found.one_sided.any()


def test_what_is_there_at_the_instant_alone_has_the_plain_window() -> None:
    light = moving((0.0, 0.0))
    bar = (slice(18, 30), slice(24, 36))
    light[AT - 20 : AT + 21, *bar] = 0.95
    stream = spikes_of(light)
    found = motion_tfp(stream, AT, 121)
    assert found.plain[bar].mean() > 0.9
    held = found.plain & (light[AT] == 0.95)
    np.testing.assert_array_equal(found.rate[held], tfp(stream, AT, 41)[held])


def test_what_is_covered_later_has_the_earlier_half() -> None:
    light = moving((0.0, 0.0))
    bar = (slice(18, 30), slice(24, 36))
    light[AT + 21 :, *bar] = 0.95  # after the coarse image of the instant
    stream = spikes_of(light)
    found = motion_tfp(stream, AT, 121)
    assert found.one_sided[bar].mean() > 0.6
    inner = found.one_sided[bar]
    error = np.abs(found.rate - light[AT])[bar][inner]
    assert error.mean() < 0.05  # the later half alone would be off by 0.7


@pytest.mark.parametrize("at", [0, 3, 397, 400])
def test_at_the_ends_of_a_stream_the_half_that_is_there_is_taken(at: int) -> None:
    light = moving((0.05, 0.0))
    found = motion_tfp(spikes_of(light), at, 121)
    assert found.one_sided.mean() > 0.9
    assert np.abs(found.rate - light[at]).mean() < 0.05


def test_a_short_stream_has_the_plain_window_and_a_dark_one_is_black() -> None:
    stream = spikes_of(moving((0.0, 0.0))[:30])
    found = motion_tfp(stream, 15, 121)
    assert found.plain.all()
    np.testing.assert_array_equal(found.rate, tfp(stream, 15, 41))
    dark = Viform.from_planes(np.zeros((CYCLES, 16, 16), np.uint8), CLOCK)
    assert not motion_tfp(dark, AT).rate.any()


def test_an_image_too_small_for_the_flow_is_refused() -> None:
    stream = Viform.from_planes(np.ones((50, LEAST, LEAST), np.uint8), CLOCK)
    assert motion_tfp(stream, 20).rate.shape == (LEAST, LEAST)
    stream = Viform.from_planes(np.ones((50, LEAST - 1, 400), np.uint8), CLOCK)
    with pytest.raises(InputError, match="the stream must be at least 12 pixels high and wide"):
        motion_tfp(stream, 20)
    with pytest.raises(InputError, match="--window must be odd"):
        motion_tfp(stream, 20, 40)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_knows_constant_light(name: str) -> None:
    stream = spikes_of(np.full((CYCLES, 16, 20), 0.25))
    np.testing.assert_allclose(reconstruct(stream, name, AT).rate, 0.25, atol=0.02)
