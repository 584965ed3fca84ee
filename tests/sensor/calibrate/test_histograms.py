"""Closed forms of latched intervals against simulated renewal processes."""

import numpy as np
import pytest

from sensor.calibrate.histograms import (
    latched_probabilities,
    latched_third,
    latched_variance,
    sample_variance,
)


def latched(mean: float, spread: float, spikes: int, pixels: int, seed: int) -> np.ndarray:
    """Cycles of successive spikes of pixels with random phases, (pixels, spikes)."""
    rng = np.random.default_rng(seed)
    shape = 1 / spread**2
    each = mean * rng.gamma(shape, 1 / shape, (pixels, spikes))
    each[:, 0] = mean * rng.uniform(0, 1, pixels) + 100 * rng.uniform(size=pixels)
    return np.ceil(np.cumsum(each, axis=1))


@pytest.mark.parametrize(("mean", "spread"), [(2.3, 0.02), (3.5, 0.05), (7.0, 0.03), (5.5, 0.2)])
def test_variance_of_a_latched_interval(mean: float, spread: float) -> None:
    intervals = np.diff(latched(mean, spread, 12, 40_000, 1), axis=1)[:, ::4]
    variance = (spread * mean) ** 2
    expected = variance + float(latched_variance(np.array(mean), variance))
    # Errors of a sample variance, with the kurtosis of the sample itself.
    off = (intervals - mean) ** 2
    assert intervals.var() == pytest.approx(expected, abs=5 * off.std() / np.sqrt(off.size))


def test_rounding_is_a_sixth_once_the_phase_is_random_and_nothing_for_whole_intervals() -> None:
    assert latched_variance(np.array(3.21), 0.5) == pytest.approx(1 / 6, abs=1e-3)
    assert latched_variance(np.array(4.0), 0.0) == pytest.approx(0.0, abs=2e-3)
    assert latched_variance(np.array(4.5), 0.0) == pytest.approx(0.25, abs=2e-3)


def test_sample_variance_of_sums_that_share_their_ends() -> None:
    mean, spread, k, blocks = 3.4, 0.05, 5, 4
    at = latched(mean, spread, k * blocks + 1, 60_000, 2)
    sums = np.diff(at[:, ::k], axis=1)
    measured = sums.var(axis=1, ddof=1)
    variance = (spread * mean) ** 2
    expected = float(sample_variance(np.array([mean]), np.array([variance]), k, blocks)[0])
    assert measured.mean() == pytest.approx(expected, abs=5 * measured.std() / np.sqrt(60_000))
    # Without the latch it is k variances; the difference must be seen, or this proves nothing.
    assert abs(measured.mean() - k * variance) > 20 * measured.std() / np.sqrt(60_000)


def test_third_moment_of_the_latch() -> None:
    mean, spread = 2.3, 0.08
    intervals = np.diff(latched(mean, spread, 9, 150_000, 3), axis=1)[:, ::4].ravel()
    third = (intervals - mean) ** 3
    variance = np.array([(spread * mean) ** 2])
    expected = 2 * spread**4 * mean**3 + float(latched_third(np.array([mean]), variance)[0])
    assert third.mean() == pytest.approx(expected, abs=5 * third.std() / np.sqrt(third.size))


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_law_of_a_latched_interval(lost: float) -> None:
    mean, spread, longest = 4.3, 0.06, 8
    rng = np.random.default_rng(4)
    shape = 1 / spread**2
    x = lost + (mean - lost) * rng.gamma(shape, 1 / shape, 400_000)
    counts = np.bincount(np.floor(x + rng.uniform(size=x.size)).astype(int), minlength=longest + 2)
    law = latched_probabilities(np.array([mean]), spread, 2 * spread, lost, longest)[0]
    assert law.sum() == pytest.approx(1, abs=1e-9)
    expected = law * x.size
    measured = np.append(counts[1 : longest + 1], counts[longest + 1 :].sum())
    assert np.all(np.abs(measured - expected) < 5 * np.sqrt(expected + 1))
