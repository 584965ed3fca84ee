"""Codewords under scattered errors and bursts; intervals.

Words of the link's codes: the measured table, and the information of a sign in noise.
"""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import beta as beta_law
from scipy.stats import binom, norm

from link.coding.ldpc import Ldpc
from link.mode import EVERY_RATE, RATES, Mode
from link.theory import (
    burst_byte_error,
    burst_word_error,
    clopper_pearson,
    ldpc_word_error,
    pointwise_level,
    rs_word_error,
    word_loss,
)
from link.theory.trials import burst_word_trials, rs_word_trials
from link.theory.words import byte_error, sign_information
from tests.link.coding.ldpc_channel import capacity, failures, noise_at


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


def needed(rate: float, share: float, data_bits: int = 8448) -> float:
    """Information at which this share of words is predicted to fail."""
    low, high = rate, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        if ldpc_word_error(rate, middle, data_bits) > share:
            low = middle
        else:
            high = middle
    return low


def check(rate: float, share: float, count: int, data_bits: int = 8448) -> None:
    """Holds that about as many words fail as predicted: within the spread of a tenth of the gap
    between one rate and the next, and the chance of the count."""
    code = Ldpc(data_bits, 8 * int(np.ceil(data_bits / rate / 8)))
    at = needed(rate, share, data_bits)
    wrong, silent = failures(code, count, noise_at(code.rate / at, code.rate), 9, 30)
    low, high = (float(n) for n in clopper_pearson(wrong, count, 0.999))
    off = 0.002  # of a bit
    assert ldpc_word_error(rate, at + off, data_bits) < high
    assert ldpc_word_error(rate, at - off, data_bits) > low
    assert silent == 0


@pytest.mark.parametrize("rate", EVERY_RATE)
def test_a_tenth_of_the_words_fails_where_it_should(rate: float) -> None:
    check(rate, 0.1, 200)


@pytest.mark.slow
@pytest.mark.parametrize("rate", EVERY_RATE)
def test_few_words_fail_where_they_should(rate: float) -> None:
    check(rate, 3e-3, 5000)
    check(rate, 0.05, 1000, 4224)


@pytest.mark.slow
@pytest.mark.parametrize("rate", EVERY_RATE)
def test_no_word_fails_above(rate: float) -> None:
    """Where one of a million should."""
    code = Ldpc(8448, 8 * int(np.ceil(8448 / rate / 8)))
    at = needed(rate, 1e-6)
    assert failures(code, 20_000, noise_at(code.rate / at, code.rate), 10, 30) == (0, 0)


def test_rates_need_more_and_more_information() -> None:
    at = [needed(rate, 1e-3) for rate in RATES]
    steps = np.diff(at)
    assert (steps > 0.01).all() and (steps < 0.05).all() and at[-1] < 0.993
    assert all(rate < information for rate, information in zip(RATES, at, strict=True))
    assert needed(0.88, 1e-3, 4224) > needed(0.88, 1e-3)


def test_the_information_of_a_sign() -> None:
    for sigma in (0.3, 0.5, 0.8, 1.5):
        assert sign_information(float(norm.sf(1 / sigma))) == pytest.approx(capacity(sigma))
    assert sign_information(0.0) == 1 and sign_information(0.5) == 0


def test_words_lost_follow_from_bit_errors() -> None:
    soft, hard = Mode(960, 960, 2, 1, "scrambled", None, 0.88), Mode(960, 960, 2, 1, "none", 32)
    assert word_loss(hard, 0.0) == 0 and word_loss(soft, 1e-6) < 1e-12
    assert word_loss(hard, 0.7) == word_loss(hard, 0.5) == pytest.approx(1)
    assert word_loss(soft, 0.7) == pytest.approx(1)
    sigma = noise_at(0.88 / needed(0.88, 0.2), 0.88)
    assert word_loss(soft, float(ndtr(-1 / sigma))) == pytest.approx(0.2, rel=1e-3)
