"""Laws of a recording, on streams whose laws are known."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock, InputError
from cosim.spikes.viform import Viform, pack_planes
from sensor.laboratory.laws import measure_laws

CYCLES = 3200


def stream(times: np.ndarray, shape: tuple[int, int]) -> Viform:
    """Spikes latched at the cycle after each instant; times: (pixels, spikes), cycles."""
    spikes = np.zeros((CYCLES, shape[0] * shape[1]), np.bool_)
    for pixel, instants in enumerate(times):
        cycle = np.ceil(instants).astype(int)
        spikes[cycle[(cycle >= 0) & (cycle < CYCLES)], pixel] = True
    return Viform(pack_planes(spikes.reshape(CYCLES, *shape)), CYCLES, Clock(40_000))


def test_accumulating_noise_and_timing_noise_have_their_correlations() -> None:
    """Rounding of both ends adds 1/6 to the variance and -1/12 to the covariance of intervals."""
    rng, shape, mean = np.random.default_rng(1), (20, 30), 6.0
    pixels, n = 600, round(CYCLES / 6) + 60
    phase = rng.uniform(0, mean, (pixels, 1))
    for accumulating, timing in ((1.0, 0.0), (0.0, 0.7), (0.5, 0.5)):
        own = np.cumsum(mean + accumulating * rng.standard_normal((pixels, n)), axis=1)
        laws = measure_laws(stream(own + phase + timing * rng.standard_normal((pixels, n)), shape))
        (law,) = (law for law in laws.intervals if law.mean == mean)
        variance = accumulating**2 + 2 * timing**2 + 1 / 6
        assert law.variance == pytest.approx(variance, rel=0.03)
        assert law.correlation == pytest.approx(-(timing**2 + 1 / 12) / variance, abs=0.01)
        assert law.histogram.sum() == pytest.approx(1)
        lengths = np.arange(1, len(law.histogram) + 1)
        assert (law.histogram * lengths).sum() == pytest.approx(mean, rel=0.01)


def test_short_series_have_the_same_laws() -> None:
    """The mean of twelve intervals is their own; both estimates allow for it."""
    rng, shape, mean = np.random.default_rng(4), (80, 100), 6.0
    pixels, n = 8000, 14
    phase = rng.uniform(0, mean, (pixels, 1))
    for accumulating, timing in ((0.5, 0.0), (0.0, 0.5), (0.0, 0.0)):
        own = np.cumsum(mean + accumulating * rng.standard_normal((pixels, n)), axis=1)
        laws = measure_laws(stream(own + phase + timing * rng.standard_normal((pixels, n)), shape))
        (law,) = (law for law in laws.intervals if law.mean == mean)
        variance = accumulating**2 + 2 * timing**2 + 1 / 6
        if accumulating or timing:
            assert law.variance == pytest.approx(variance, rel=0.06)
            assert law.correlation == pytest.approx(-(timing**2 + 1 / 12) / variance, abs=0.03)
        else:  # intervals of a whole number of cycles
            assert law.variance == 0 and np.isnan(law.correlation)


def test_the_pattern_is_found_beside_a_scene() -> None:
    """Gains of 2 % on a gradient, one row at +4 %, a few warm pixels, and common flicker."""
    rng, shape = np.random.default_rng(2), (60, 80)
    gain = 1 + 0.02 * rng.standard_normal(shape)
    gain[30] += 0.04
    gain.ravel()[rng.choice(gain.size, 12, replace=False)] += 0.5
    rate = 0.2 * (1 + 0.5 * np.arange(80) / 80) * gain
    flicker = np.cumsum(1 + 0.01 * np.repeat(rng.standard_normal(CYCLES // 64), 64))
    phase = rng.random(shape)
    fired = np.floor(rate * flicker[:, None, None] + phase)
    spikes = np.diff(fired, axis=0, prepend=np.floor(phase)[None]) > 0
    laws = measure_laws(Viform(pack_planes(spikes), CYCLES, Clock(40_000)))
    assert laws.core == pytest.approx(0.02, rel=0.15)
    assert laws.above == 12 and laws.below == 0 and 0.08 < laws.highest < 0.18
    assert laws.kurtosis > 50 and laws.rows > 2 * laws.columns
    assert laws.rate.mean() == pytest.approx(rate.mean(), rel=0.01)
    # Independent pixels: their phases alone; the flicker is common to all 4800.
    assert laws.common > 100
    assert max(map(abs, laws.neighbours)) < 0.1


def test_light_that_was_not_still_is_told() -> None:
    """Thresholds with noise under light that swings by a half in 800 cycles, and under still
    light."""
    rng, shape, mean = np.random.default_rng(6), (40, 50), 4.0
    cycles = np.arange(CYCLES)
    for swing, still in ((0.0, True), (0.5, False)):
        light = (1 + swing * np.sin(2 * np.pi * cycles / 800)) / mean
        charge = np.concatenate([[0.0], np.cumsum(light)])
        goal = np.cumsum(1 + 0.1 * rng.standard_normal((2000, 900)), axis=1)
        times = np.interp(goal - 1 + rng.random((2000, 1)), charge, np.arange(CYCLES + 1.0))
        laws = measure_laws(stream(times, shape))
        assert (laws.motion is None) is still
    assert laws.motion is not None
    assert "correlate by +0." in laws.motion and "the common noise is" in laws.motion


def test_a_stream_that_says_nothing_is_refused() -> None:
    for cycles, said in ((32, "of 64 cycles or more"), (128, "one with spikes")):
        words = np.zeros((cycles // 32, 4, 4), np.uint32)
        with pytest.raises(InputError, match=said):
            measure_laws(Viform(words, cycles, Clock(40_000)))
