"""Fixed pattern, dark current, threshold noise, reset rules and dead time, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy import stats

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import Device, open_device
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera
from sensor.circuit.circuit import ktc_electrons
from sensor.device.pattern import DevicePattern, dark_current
from sensor.latched.effects import RESIDUAL, SHOT_NOISE
from sensor.latched.effects.initial_charge import INITIAL_CHARGE
from sensor.latched.pixel.charge import ONE, Span, to_fixed
from sensor.latched.pixel.compiled import CompiledPixels
from sensor.latched.pixel.interval import interval_table
from sensor.latched.pixel.kernel import KernelPixels
from sensor.latched.pixel.model import ExactModel, Reset
from sensor.latched.pixel.numpy_form import NumpyPixels
from sensor.latched.pixel.thresholds import thresholds

CLOCK = Clock(40_000)
N = 200_000
PIXELS = np.arange(N, dtype=np.uint32)


@pytest.mark.parametrize("dead_time", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("reset", get_args(Reset))
@pytest.mark.parametrize("noise", [False, True])
def test_the_forms_agree_under_every_reset_rule_and_dead_time(
    device: Device, reset: Reset, dead_time: float, noise: bool
) -> None:
    n, cycles, q = 501, 150, 300.0
    random = np.random.default_rng(2)
    first = to_fixed(q * 10 ** random.uniform(-4, 1.5, n))
    slope = (to_fixed(q * 10 ** random.uniform(-4, 1.5, n)) - first) // 200
    effects = (RESIDUAL, INITIAL_CHARGE, SHOT_NOISE) if noise else (RESIDUAL,)
    model = ExactModel(q, 7, effects, 5.0 if noise else 0.0, reset, dead_time)
    pixels = np.arange(n, dtype=np.uint32)
    for ramp in (None, slope):
        plain = NumpyPixels(model, pixels)
        words = plain.expose([Span(0, cycles, first, ramp)], cycles)
        for form in (CompiledPixels(model, pixels), KernelPixels(model, pixels, device)):
            spans = [Span(0, 65, first, ramp), Span(65, cycles - 65, first, ramp, 65)]
            assert np.array_equal(form.expose(spans, cycles), words)
            assert np.array_equal(form.state().deficit, plain.state().deficit)
        assert words.any()


def test_reset_rules_differ_as_random_bits_on_the_light_show(device: Device) -> None:
    # On-off light, Q = 100, ON 1.4 Q, OFF b Q a cycle, one bit a cycle. Hard: ON fails if fewer
    # than Q electrons arrive, OFF if the charge of OFF cycles adds up to Q. Residual: the excess of
    # ON cycles is uniform, so OFF cycles fire at a rate of b. Subtract: charge accumulates
    # until all of it has fired: (1.4 + b)/2 - 1/2.
    n, cycles, q = 4000, 400, 100.0
    bits = np.random.default_rng(4).integers(0, 2, (cycles, n))
    pixels = np.arange(n, dtype=np.uint32)
    found: dict[tuple[str, float], float] = {}
    for reset in get_args(Reset):
        for b in (0.0, 0.01, 0.1):
            light = np.where(bits == 1, int(140 * ONE), int(100 * b * ONE))
            spans = [Span(i, 1, light[i]) for i in range(cycles)]
            model = ExactModel(q, 5, (RESIDUAL, SHOT_NOISE), 0.0, reset)
            words = KernelPixels(model, pixels, device).expose(spans, cycles)
            got = np.array([(words[i // 32] >> np.uint32(i % 32)) & 1 for i in range(cycles)])
            found[reset, b] = float((got != bits).mean())
    trials = n * cycles
    missed = stats.poisson(140).cdf(99) / 2
    assert abs(found["hard", 0.0] - missed) < 4.9 * math.sqrt(missed / trials)
    assert found["hard", 0.01] == pytest.approx(5e-5, abs=2e-5)
    assert found["hard", 0.1] == pytest.approx(5e-4, rel=0.2)
    assert found["residual", 0.0] < 2e-5
    for b in (0.01, 0.1):
        assert found["residual", b] == pytest.approx(b / 2, rel=0.05)
    for b in (0.0, 0.01, 0.1):
        assert found["subtract", b] == pytest.approx((1.4 + b) / 2 - 0.5, rel=0.03)


def test_dead_time_lengthens_every_interval_by_itself(device: Device) -> None:
    # Rate of the pixel: 1 / (Q / light + dead time), counted over many intervals.
    q, cycles, dead = 1000.0, 6400, 0.4
    light = np.array([30.0, 120.0, 400.0, 700.0])
    model = ExactModel(q, 1, (RESIDUAL,), 0.0, "residual", dead)
    pixels = KernelPixels(model, np.arange(4, dtype=np.uint32), device)
    words = pixels.expose([Span(0, cycles, to_fixed(light))], cycles)
    counts = np.bitwise_count(words).sum(axis=0)
    expected = cycles / (q / light + round(dead * 65536) / 65536)
    assert np.abs(counts - expected).max() <= 1


def test_the_pattern_has_the_spread_asked_for_and_belongs_to_the_device_seed() -> None:
    pattern = DevicePattern(prnu=0.05, dark=40.0, dsnu=0.2, device_seed=3)
    found = pattern.at(PIXELS)
    root = math.sqrt(2 * N)
    assert found.gain.mean() == pytest.approx(1, abs=4.9 * 0.05 / math.sqrt(N))
    assert found.gain.std() == pytest.approx(0.05, rel=4.9 / root)
    assert found.dark.mean() == pytest.approx(40, abs=4.9 * 8 / math.sqrt(N))
    assert found.dark.std() == pytest.approx(8, rel=4.9 / root)
    z = np.corrcoef(found.gain, found.dark)[0, 1] * math.sqrt(N)
    assert abs(z) < 4.9
    assert np.array_equal(pattern.at(PIXELS[5000:6000]).gain, found.gain[5000:6000])
    other = DevicePattern(prnu=0.05, dark=40.0, dsnu=0.2, device_seed=4).at(PIXELS)
    assert abs(np.corrcoef(found.gain, other.gain)[0, 1]) * math.sqrt(N) < 4.9


def test_hot_and_dead_pixels_are_the_share_asked_for() -> None:
    found = DevicePattern(hot=0.01, hot_current=5000.0, dead=0.002, device_seed=1).at(PIXELS)
    for share, expected in (((found.dark == 5000).mean(), 0.01), ((found.gain == 0).mean(), 0.002)):
        assert abs(share - expected) < 4.9 * math.sqrt(expected / N)


def test_threshold_pattern_scales_light_and_dark_current_alike() -> None:
    found = DevicePattern(dark=10.0, threshold_fpn=0.03, device_seed=9).at(PIXELS)
    assert np.allclose(found.dark / found.gain, 10, rtol=1e-6)
    assert (1 / found.gain).std() == pytest.approx(0.03, rel=4.9 / math.sqrt(2 * N))


@pytest.mark.parametrize(("celsius", "dark"), [(25.0, 2000.0), (38.0, 8000.0), (51.0, 32_000.0)])
def test_a_camera_in_the_dark_counts_its_dark_current(celsius: float, dark: float) -> None:
    # 2000 e/s at 25 degrees doubles every 6.5 K; no light at all.
    assert dark_current(2000.0, celsius) == pytest.approx(dark)
    pattern = DevicePattern(dark=dark_current(2000.0, celsius), prnu=0.1)
    setting = CameraSetting(CHIPS["spikeone"], CLOCK, 10.0, 1, pattern=pattern)
    black = np.zeros((250, 400), np.float32)
    camera = SpikeCamera(setting, open_device())
    words = camera.step(Light((Piece(0, PS, black, black),)), Block(0, 640)).words
    expected = dark * 640 / 40_000 / 10.0 * 100_000
    # Shot noise of the electrons, and rounding to whole spikes.
    spread = math.sqrt(expected * 10.0) / 10.0
    assert np.bitwise_count(words).sum() == pytest.approx(expected, abs=4.9 * spread + 100)


def test_kTC_noise_is_the_figure_of_the_field() -> None:
    assert ktc_electrons(5e-15) == pytest.approx(28.4, abs=0.05)
    for farad, electrons in ((10e-15, 40), (20e-15, 57)):
        assert round(ktc_electrons(farad)) == electrons


@pytest.mark.parametrize(
    ("q", "sigma"), [(100.0, 2.0), (100.0, 28.4), (1000.0, 5.0), (30_000.0, 150.0), (28.4, 28.4)]
)
def test_threshold_noise_adds_to_shot_noise_in_one_draw(q: float, sigma: float) -> None:
    draws = thresholds(interval_table(q, sigma), np.zeros(N, np.uint64), PIXELS, 1) / ONE
    random = np.random.default_rng(5)
    sample = random.gamma(q, size=10 * N) + random.normal(0, sigma, 10 * N)
    assert stats.ks_2samp(draws, np.maximum(sample, 1 / ONE)).pvalue > 1e-6
    at_once = (draws <= 2 / ONE).mean()
    expected = (sample <= 0).mean()
    assert abs(at_once - expected) < 4.9 * math.sqrt((expected + 1e-6) * 1.1 / N)


def test_threshold_noise_alone_is_normal() -> None:
    draws = thresholds(interval_table(5000.0, 40.0, False), np.zeros(N, np.uint64), PIXELS, 2) / ONE
    assert stats.kstest(draws, stats.norm(5000, 40).cdf).pvalue > 1e-6


def test_bad_sizes_are_refused() -> None:
    for words in ({"prnu": -0.1}, {"dark": float("nan")}, {"hot": 1.5}, {"dead": -1e-9}):
        with pytest.raises(ValueError, match=f"{next(iter(words))} must be"):
            DevicePattern(**words)
    effects = tuple(EFFECTS.values())
    with pytest.raises(ValueError, match="dead time must be 0 to 1 cycle"):
        ExactModel(100.0, 1, effects, 0.0, "residual", 1.5)
    with pytest.raises(ValueError, match="threshold noise must be"):
        ExactModel(100.0, 1, effects, -1.0)


def test_rows_columns_and_neighbours_have_their_parts_in_common() -> None:
    """Variances of means and products of neighbours, against their closed forms."""
    height, width, r = 300, 400, 0.3
    numbers = np.arange(height * width, dtype=np.uint32)
    made = DevicePattern(
        prnu=0.02, rows=0.004, columns=0.002, along_row=r, along_column=0.15, width=width
    )
    gain = made.at(numbers).gain.reshape(height, width) - 1
    own = gain - gain.mean(axis=1, keepdims=True) - gain.mean(axis=0) + gain.mean()
    assert own.std() == pytest.approx(0.02, rel=0.02)
    near = [(own[:, n:] * own[:, :-n]).mean() / own.var() for n in (1, 2, 3)]
    a = (1 - np.sqrt(1 - 2 * r * r)) / (2 * r)
    expected = [r, a * a / (1 + 2 * a * a), 0]
    assert near == pytest.approx(expected, abs=0.015)
    assert (own[1:] * own[:-1]).mean() / own.var() == pytest.approx(0.15, abs=0.015)
    for axis, n, size, alike in ((1, width, 0.004, r), (0, height, 0.002, 0.15)):
        b = (1 - np.sqrt(1 - 2 * alike**2)) / (2 * alike)
        pixels = 0.02**2 * (1 + 2 * b) ** 2 / (1 + 2 * b * b) / n
        lines = gain.mean(axis=axis).var(ddof=1)
        assert lines == pytest.approx(size**2 + pixels, rel=0.25)
    some = numbers[5000:5100]
    np.testing.assert_array_equal(made.at(some).gain, made.at(numbers).gain[some])
    # Without them the bits are those of before, whatever the width.
    plain = DevicePattern(prnu=0.02, device_seed=3)
    np.testing.assert_array_equal(replace(plain, width=width).at(some).gain, plain.at(some).gain)
    with pytest.raises(ValueError, match="width must be 1 or more"):
        DevicePattern(rows=0.01).at(some)
    with pytest.raises(ValueError, match=r"along_row must be 0 to 0\.6"):
        DevicePattern(along_row=0.7, width=4)
