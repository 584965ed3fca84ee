"""Codewords under scattered errors and bursts; intervals."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.stats import beta as beta_law
from scipy.stats import binom

from link.theory import (
    burst_byte_error,
    burst_word_error,
    clopper_pearson,
    pointwise_level,
    rs_word_error,
)
from link.theory.trials import burst_word_trials, rs_word_trials
from link.theory.words import byte_error


def test_the_binomial_sum() -> None:
    p = 0.05
    due = sum(comb(255, j) * p**j * (1 - p) ** (255 - j) for j in range(17, 256))
    assert float(rs_word_error(255, 223, p)) == pytest.approx(due, rel=1e-10)
    assert float(rs_word_error(255, 223, 1e-6)) == pytest.approx(
        comb(255, 17) * 1e-6**17, rel=1e-3
    )  # one ends up with 0 by 1 - cdf
    assert 1 - binom.cdf(16, 255, 1e-6) == 0
    assert float(byte_error(1e-20)) == pytest.approx(8e-20) and float(byte_error(0.5)) == 1 - 2**-8
    with pytest.raises(ValueError, match="k must be"):
        rs_word_error(10, 11, 0.1)


def test_bursts_against_every_pattern() -> None:
    """A short code: all patterns of starts that a word and the bytes before it can have."""
    n, k, start, length = 6, 4, 0.2, 3
    total = 0.0
    for pattern in range(1 << (n + length - 1)):
        starts = [(pattern >> i) & 1 for i in range(n + length - 1)]
        chance = np.prod([start if s else 1 - start for s in starts])
        wrong = sum(any(starts[i : i + length]) for i in range(n))
        total += chance * (wrong > (n - k) // 2)
    assert burst_word_error(n, k, start, length) == pytest.approx(total, rel=1e-12)
    assert burst_word_error(n, k, start, 1) == pytest.approx(float(rs_word_error(n, k, start)))


def test_an_interleaver_makes_bursts_scattered_errors() -> None:
    start, length = 0.0018, 16
    p = float(burst_byte_error(start, length))
    assert burst_word_error(255, 223, start, length, 16) == float(rs_word_error(255, 223, p))
    assert burst_word_error(255, 223, start, length) > 50 * burst_word_error(
        255, 223, start, length, 16
    )
    with pytest.raises(ValueError, match="depth"):
        burst_word_error(255, 223, start, length, 5)


@pytest.mark.parametrize("depth", [1, 32])
def test_simulated_bursts(depth: int) -> None:
    start, length, words = 0.0027, 16, 4000
    errors = burst_word_trials(255, 223, start, length, depth, words, 1, depth)
    low, high = clopper_pearson(errors, words, 1 - 1e-6)
    scattered = float(rs_word_error(255, 223, burst_byte_error(start, length)))
    due = burst_word_error(255, 223, start, length, depth)
    assert errors >= 100 and low < due < high
    assert bool(low < scattered < high) is (depth > 1)  # without interleaver it visibly fails


def test_simulated_scattered_errors() -> None:
    errors = rs_word_trials(255, 223, 0.05, 3000, 1, 9)
    low, high = clopper_pearson(errors, 3000, 1 - 1e-6)
    assert errors >= 100 and low < float(rs_word_error(255, 223, 0.05)) < high


class TestIntervals:
    def test_limits_are_beta_quantiles(self) -> None:
        low, high = clopper_pearson(7, 50, 0.99)
        assert float(low) == pytest.approx(beta_law.ppf(0.005, 7, 44))
        assert float(high) == pytest.approx(beta_law.ppf(0.995, 8, 43))

    def test_none_and_all(self) -> None:
        low, high = clopper_pearson([0, 9], [9, 9], 0.95)
        assert low[0] == 0 and high[1] == 1
        assert high[0] == pytest.approx(1 - 0.025 ** (1 / 9)) and low[1] == pytest.approx(
            0.025 ** (1 / 9)
        )

    def test_the_truth_is_inside_as_often_as_promised(self) -> None:
        """By summation over all outcomes, not by chance."""
        n, k = 40, np.arange(41)
        low, high = clopper_pearson(k, np.full(41, n), 0.9)
        for p in (0.02, 0.3, 0.5):
            assert binom.pmf(k, n, p)[(low <= p) & (p <= high)].sum() >= 0.9

    def test_points_share_the_misses(self) -> None:
        assert pointwise_level(0.99, 100) == pytest.approx(0.9999)
        assert pointwise_level(0.99, 0) == pytest.approx(0.99)

    def test_nonsense_is_refused(self) -> None:
        with pytest.raises(ValueError, match="errors must be"):
            clopper_pearson(3, 2)
