"""Draws follow their laws, by exact tests at 1e-6, and hang on nothing but their counters."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cosim.compute.draws import binomial, gamma, negative_binomial, normal, poisson
from cosim.compute.streams import Stream

N = 40_000
NUMBERS = np.arange(N)
ALPHA = 1e-6


def follows(counts: np.ndarray, law: object) -> None:
    """Chi-square over values of at least 20 expected, the rest together in two ends."""
    low, high = (int(law.ppf(q)) for q in (25 / N, 1 - 25 / N))  # type: ignore[attr-defined]
    edges = np.unique(np.linspace(low, high, 40).astype(int))
    cdf = np.concatenate([[0.0], law.cdf(edges), [1.0]])  # type: ignore[attr-defined]
    observed = np.diff(
        np.concatenate([[0], np.searchsorted(np.sort(counts), edges, "right"), [counts.size]])
    )
    expected = np.diff(cdf) * counts.size
    keep = expected > 5
    observed = np.append(observed[keep], observed[~keep].sum())
    expected = np.append(expected[keep], expected[~keep].sum())
    if expected[-1] < 5:
        observed, expected = (
            observed[:-1],
            expected[:-1] * observed[:-1].sum() / expected[:-1].sum(),
        )
    assert stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue > ALPHA


@pytest.mark.parametrize("mean", [0.01, 0.7, 5.0, 11.9, 12.1, 30.0, 1000.0, 3e6])
def test_poisson(mean: float) -> None:
    follows(poisson(mean, NUMBERS, 3, 1, Stream.IMAGER_SHOT), stats.poisson(mean))


@pytest.mark.parametrize(("count", "mean"), [(1, 0.5), (1, 99.0), (3, 10.0), (500, 4.0)])
def test_negative_binomial(count: int, mean: float) -> None:
    found = negative_binomial(count, mean, NUMBERS, 0, 1, Stream.IMAGER_GAIN)
    follows(found, stats.nbinom(count, 1 / (1 + mean)))


@pytest.mark.parametrize(("count", "share"), [(1, 0.3), (16, 0.8), (17, 0.5), (1000, 0.05)])
def test_binomial(count: int, share: float) -> None:
    follows(binomial(count, share, NUMBERS, 0, 1, Stream.IMAGER_LOSS), stats.binom(count, share))


@pytest.mark.parametrize("shape", [0.3, 1.0, 2.5, 400.0])
def test_gamma(shape: float) -> None:
    found = gamma(shape, NUMBERS, 0, 1, Stream.IMAGER_GAIN)
    assert stats.kstest(found, stats.gamma(shape).cdf).pvalue > ALPHA


def test_normal() -> None:
    assert stats.kstest(normal(NUMBERS, 0, 1, Stream.IMAGER_READ), "norm").pvalue > ALPHA


def test_no_draw_where_there_is_nothing() -> None:
    for mean in (0.0, -1.0):
        assert not poisson(mean, NUMBERS, 0, 1, Stream.IMAGER_SHOT).any()
    assert not negative_binomial(0, 5.0, NUMBERS, 0, 1, Stream.IMAGER_GAIN).any()
    assert (binomial(7, 1.0, NUMBERS, 0, 1, Stream.IMAGER_LOSS) == 7).all()


def test_a_part_of_a_frame_draws_as_the_whole() -> None:
    mean = np.linspace(0, 60, N)
    whole = poisson(mean, NUMBERS, 7, 1, Stream.IMAGER_SHOT)
    part = poisson(mean[500:900], NUMBERS[500:900], 7, 1, Stream.IMAGER_SHOT)
    assert (whole[500:900] == part).all()
    assert (whole != poisson(mean, NUMBERS, 8, 1, Stream.IMAGER_SHOT)).any()


def test_a_little_more_light_is_a_little_more_in_the_same_draw() -> None:
    """Paired runs stay paired: 1 % of a mean of 100 moves them by less than chance does."""
    one, other = (poisson(m, NUMBERS, 0, 1, Stream.IMAGER_SHOT) for m in (100.0, 101.0))
    assert np.std(one - other) < 0.35 * np.sqrt(200)


def test_a_large_plane_is_drawn_on_several_threads_as_in_pieces(monkeypatch):
    """Each pixel has its own counter: one thread, three, and pieces give the same bits."""
    import cosim.compute.draws as draws

    numbers = np.arange(3 * draws._PART + 17, dtype=np.int64).reshape(1, -1)
    mean = np.linspace(0.0, 40.0, numbers.size).reshape(numbers.shape)
    many = np.full(numbers.shape, 5)
    made = []
    for cores in (1, 3):
        monkeypatch.setattr("cosim.compute.cores.cores", lambda cores=cores: cores)
        given = numbers, 7, 3, Stream.IMAGER_SHOT
        made.append([
            draws.poisson(mean, *given), draws.normal(*given), draws.gamma(mean, *given),
            draws.negative_binomial(many, mean, *given), draws.binomial(many, mean / 40, *given),
        ])  # fmt: skip
    piece = slice(draws._PART - 5, draws._PART + 900)
    cut = draws.poisson(mean[:, piece], numbers[:, piece], 7, 3, Stream.IMAGER_SHOT)
    assert (cut == made[1][0][:, piece]).all()
    assert all((one == other).all() for one, other in zip(*made, strict=True))
