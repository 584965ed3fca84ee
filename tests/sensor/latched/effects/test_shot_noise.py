"""Shot noise: thresholds are Gamma(Q), window counts have the exact law, streams are independent.

Fixed seeds, alpha 1e-6 a test. Latched intervals are never put to a continuous test.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from cosim import Clock, Summary
from cosim.compute.opencl import open_device
from sensor import CHIPS, CameraSetting
from sensor.latched.effects import EFFECTS, RESIDUAL, SHOT_NOISE
from sensor.latched.effects.initial_charge import INITIAL_CHARGE
from sensor.latched.pixel.charge import ONE, Span, to_fixed
from sensor.latched.pixel.interval import KNOTS, MANTISSA_BITS, interval_table, threshold
from sensor.latched.pixel.kernel import KernelPixels
from sensor.latched.pixel.model import ExactModel
from sensor.latched.pixel.thresholds import initial_deficit, thresholds

ALPHA = 1e-6
N = 400_000


def draws(q: float, seed: int = 1, spike: int = 0) -> np.ndarray:
    k = np.full(N, spike, np.uint64)
    return thresholds(interval_table(q), k, np.arange(N, dtype=np.uint32), seed) / ONE


@pytest.mark.parametrize("q", [1.0, 100.0, 1000.0, 30_000.0])
def test_thresholds_are_gamma_q(q: float) -> None:
    sample = draws(q)
    assert stats.kstest(sample, stats.gamma(q).cdf).pvalue > ALPHA
    z = (sample.mean() - q) / math.sqrt(q / N)
    assert abs(z) < 4.9
    # The sample variance of Gamma(q): mean q, variance q^2 (2/N + 6/(q N)).
    spread = q * math.sqrt((2 + 6 / q) / N)
    assert abs(sample.var() - q) < 4.9 * spread


@pytest.mark.parametrize(
    ("q", "rsd"), [(1.0, 1.0), (100.0, 0.1), (1000.0, 0.0316), (10_000.0, 0.01)]
)
def test_relative_spread_is_one_over_root_q(q: float, rsd: float) -> None:
    sample = draws(q)
    spread = math.sqrt((0.5 + 1.5 / q) / N)  # of the relative standard deviation, relative
    assert sample.std() / sample.mean() == pytest.approx(1 / math.sqrt(q), rel=4.9 * spread + 1e-5)
    assert round(1 / math.sqrt(q), 4) == rsd


@pytest.mark.parametrize("q", [0.3, 1.0, 7.5, 100.0, 30_000.0, 2e6])
def test_the_table_follows_the_quantiles_down_to_both_tails(q: float) -> None:
    table = interval_table(q)
    y = np.unique(
        np.concatenate([np.arange(300), np.geomspace(300, 2**31 - 1, 3000).astype(np.int64)])
    )
    for word, p, law in ((y, (y + 0.5) / 2**32, stats.gamma(q).cdf),
                         (2**32 - 1 - y, (y + 0.5) / 2**32, stats.gamma(q).sf)):  # fmt: skip
        value = threshold(table, word.astype(np.uint32)) / ONE
        fine = value > 2**14 / ONE  # below, the fixed point itself is coarser than the law
        # Linear interpolation costs 8e-6; scipy itself is off in the tails of the largest Q.
        assert np.allclose(law(value[fine]), p[fine], rtol=5e-5 if q < 1e6 else 6e-4, atol=0)


def test_the_table_is_monotone_and_never_zero() -> None:
    for q in (0.01, 1.0, 1000.0):
        table = interval_table(q)
        assert (table > 0).all()
        assert (np.diff(table[:KNOTS]) >= 0).all()
        assert (np.diff(table[KNOTS:]) <= 0).all()
    assert KNOTS == (31 - MANTISSA_BITS + 1) * 2**MANTISSA_BITS + 1


@pytest.mark.parametrize("q", [1.0, 3.0, 100.0])
def test_window_counts_have_the_exact_law(q: float) -> None:
    # From an empty pixel: P(N = k) = F((k+1)Q - 1) - F(kQ - 1), F of Poisson(electrons).
    n, cycles, mean = 200_000, 64, 6.5 * q
    model = ExactModel(q, 21, (RESIDUAL, SHOT_NOISE))
    pixels = KernelPixels(model, np.arange(n, dtype=np.uint32), open_device())
    # In several spans, one of them a ramp: the distribution depends only on the integral of light.
    # Charges mean/128, then rising by slope, then mean/128 again: chosen to sum to mean.
    flat = to_fixed(np.full(n, mean / 128))
    rise = np.full(n, int(mean / 2 / 31 / 16 * ONE / 2), np.int64)
    spans = [Span(0, 16, flat), Span(16, 32, flat, rise), Span(48, 16, flat)]
    total = (64 * flat[0] + rise[0] * (31 * 32 // 2)) / ONE
    pixels.expose(spans, cycles)
    counts = pixels.state().spikes.astype(np.int64)
    k = np.arange(counts.max() + 2)
    law = stats.poisson(total)
    expected = n * np.append(law.cdf((k + 1) * q - 1) - law.cdf(k * q - 1), 0)[: k.size]
    observed = np.bincount(counts, minlength=k.size)
    big = expected >= 5
    pooled_observed = np.append(observed[big], observed[~big].sum())
    pooled_expected = np.append(expected[big], n - expected[big].sum())
    if pooled_expected[-1] < 5:
        pooled_observed[-2] += pooled_observed[-1]
        pooled_expected[-2] += pooled_expected[-1]
        pooled_observed, pooled_expected = pooled_observed[:-1], pooled_expected[:-1]
    assert (
        stats.chisquare(pooled_observed, pooled_expected * n / pooled_expected.sum()).pvalue > ALPHA
    )


def test_draws_of_pixels_spikes_seeds_and_effects_are_independent() -> None:
    base = draws(1000.0)
    others = {
        "next pixel": np.roll(base, 1),
        "next spike": draws(1000.0, spike=1),
        "fourth spike": draws(1000.0, spike=4),
        "spike 2^32 on": draws(1000.0, spike=2**32),
        "seed": draws(1000.0, seed=2),
        "initial charge": initial_deficit(
            np.full(N, ONE, np.int64), np.arange(N, dtype=np.uint32), 1
        ).astype(float),
    }
    for name, other in others.items():
        z = np.corrcoef(base, other)[0, 1] * math.sqrt(N)
        assert abs(z) < 4.9, name


def test_initial_charge_is_uniform_below_the_threshold() -> None:
    first = np.full(N, 1000 * ONE, np.int64)
    deficit = initial_deficit(first, np.arange(N, dtype=np.uint32), 3)
    assert deficit.min() >= 0
    charge = (first - 1 - deficit) / first
    assert stats.kstest(charge, "uniform").pvalue > ALPHA
    # With random initial charge, pixels of equal brightness do not fire in phase.
    model = ExactModel(1000.0, 3, (RESIDUAL, INITIAL_CHARGE))
    pixels = KernelPixels(model, np.arange(N, dtype=np.uint32), open_device())
    words = pixels.expose([Span(0, 1, np.full(N, 250 * ONE, np.int64))], 1)
    share = (words[0] & 1).mean()
    assert abs(share - 0.25) < 4.9 * math.sqrt(0.25 * 0.75 / N)


def test_the_bound_of_shot_noise_holds_and_is_not_loose() -> None:
    # Without shot noise, the error of a window's rate (spikes and the change of stored charge over
    # Q) is the Poisson noise of the accumulated electrons.
    n, cycles, q, per_cycle = 100_000, 64, 100.0, 20.0
    scene = Summary(per_cycle, per_cycle, q, cycles, cycles, spread=1 / math.sqrt(q))
    model = ExactModel(q, 5, tuple(EFFECTS.values()))
    noisy = KernelPixels(model, np.arange(n, dtype=np.uint32), open_device())
    before = noisy.state()
    noisy.expose([Span(0, cycles, np.full(n, int(per_cycle * ONE), np.int64))], cycles)
    after = noisy.state()
    # The fraction of each interval is relative to its own threshold.
    spikes = after.spikes.astype(float) - before.spikes.astype(float)
    variance = spikes.var() * (q / (per_cycle * cycles)) ** 2
    setting = CameraSetting(CHIPS["spiketwo"], Clock(40_000), q, 5, effects=(SHOT_NOISE,))
    bound = SHOT_NOISE.bound(setting, scene)
    # An estimate and no limit: the noise of a tile may be above or below its expected size.
    assert bound.kind == "estimate"
    # At a fifth of a threshold a cycle, two spikes almost never fall in one cycle.
    assert bound.value == pytest.approx(1 / math.sqrt(per_cycle * cycles), rel=1e-6)
    # Integer counts add the rounding of a spike (at most 1/4) to the noise.
    rounding = 0.25 * (q / (per_cycle * cycles)) ** 2
    assert bound.value**2 <= variance * 1.1
    assert variance <= (bound.value**2 + rounding) * 1.1


@pytest.mark.parametrize("q", [1.0, 10.0, 1000.0])
def test_a_run_starts_in_the_stationary_law(q: float) -> None:
    # The mean count of any window is exactly light / Q, from the first cycle on. A uniform
    # share of a plain Gamma(Q) threshold would give half an electron, 1/(2Q) spikes, too many.
    n, cycles, light = 1_000_000, 4, 0.7 * q / 4
    model = ExactModel(q, 13, tuple(EFFECTS.values()))
    pixels = KernelPixels(model, np.arange(n, dtype=np.uint32), open_device())
    charge = to_fixed(np.full(n, light))
    pixels.expose([Span(0, cycles, charge)], cycles)
    counts = pixels.state().spikes.astype(float)
    expected = cycles * charge[0] / ONE / q
    assert abs(counts.mean() - expected) < 4.9 * counts.std() / math.sqrt(n)
