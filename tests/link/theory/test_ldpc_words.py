"""Words of the link's codes: the measured table, and the information of a sign in noise."""

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import norm

from link.coding.ldpc import Ldpc
from link.mode import EVERY_RATE, RATES, Mode
from link.theory import clopper_pearson, ldpc_word_error, word_loss
from link.theory.ldpc_words import sign_information
from tests.link.coding.ldpc_channel import capacity, failures, noise_at


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
