"""Expected shares of lost words and frames: their formulas, and when they are not known."""

import numpy as np
import pytest
from scipy.stats import binom

from link.evaluation.metrics import LostShare, _quantile, lost_share
from link.mode import Mode
from link.theory import ldpc_word_error
from link.theory.soft_information import SoftInformation

SOFT = Mode(960, 960, 2, 1, "scrambled", None, 0.88)


def information(bits: float, half: float = 0.0) -> SoftInformation:
    return SoftInformation(bits, bits - half, bits + half, 1.0)


def test_half_of_the_words_fail_where_the_table_says():
    found = lost_share(SOFT, 8448, information(0.9001), 0.0, 1000)
    assert found.value == pytest.approx(0.5)
    ends = [ldpc_word_error(0.88, 0.9001 + off) for off in (0.002, -0.002)]
    assert found.low == binom.ppf(0.0005, 1000, ends[0]) / 1000
    assert found.high == binom.ppf(0.9995, 1000, ends[1]) / 1000
    assert found.low < 0.35 < 0.65 < found.high


def test_frames_of_two_words():
    """Lost with either; their limits hold whether words fail together or not."""
    words = lost_share(SOFT, 8448, information(0.908), 0.0, 10_000)
    frames = lost_share(SOFT, 8448, information(0.908), 0.0, 10_000, 2)
    assert frames.value == pytest.approx(1 - (1 - words.value) ** 2)
    assert frames.low == words.low and words.high < frames.high <= 2 * words.high + 0.01


@pytest.mark.parametrize(
    ("mode", "of", "drift", "words"),
    [
        (Mode(960, 960, 2, 1, "scrambled", 32), information(0.9), 0.0, 100),
        (SOFT, None, 0.0, 100),
        (SOFT, information(0.9), -0.1, 100),
        (SOFT, information(0.9), 0.0, 0),
    ],
)
def test_what_is_not_known_is_none(mode, of, drift, words):
    assert lost_share(mode, 8448, of, drift, words) == LostShare()


def test_limits_hold_for_runs_of_any_information_in_the_interval():
    """Drawn runs, also at the ends of the information's interval."""
    rng = np.random.default_rng(1)
    found = lost_share(SOFT, 8448, information(0.906, 0.003), 0.0, 500)
    for true in (0.903, 0.906, 0.909):
        lost = rng.binomial(500, ldpc_word_error(0.88, true), 2000) / 500
        assert ((lost >= found.low) & (lost <= found.high)).mean() > 0.999


def test_quantiles_are_those_of_the_binomial_law():
    random = np.random.default_rng(1)
    for _ in range(500):
        count, tiny = int(random.integers(1, 100_000)), random.random() < 0.3
        share = 10 ** random.uniform(-320 if tiny else -7, 0)
        for chance in (0.0005, 0.9995):
            assert _quantile(chance, count, share) == max(binom.ppf(chance, count, share), 0)
    assert _quantile(0.5, 10, 1.0) == 10
