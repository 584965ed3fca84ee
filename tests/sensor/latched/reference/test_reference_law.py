"""The exact distribution of a threshold against its definition, by quadrature, in both tails."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, special, stats

from sensor.latched.pixel.charge import ONE
from sensor.latched.pixel.interval import interval_table, threshold
from sensor.latched.reference.law import (
    LEAST,
    draw_all,
    law_error,
    law_of,
    mixed_law,
    mixed_quantiles,
)

WORDS = np.concatenate(
    [
        [0, 1, 77, 2**31 - 1, 2**31, 2**32 - 78, 2**32 - 2, 2**32 - 1],
        np.random.default_rng(1).integers(0, 2**32, 40),
    ]
).astype(np.uint32)


def tails(words: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper tail of each word, each with full precision."""
    return (words + 0.5) / 2.0**32, ((~words) + 0.5) / 2.0**32


def scores(words: np.ndarray) -> np.ndarray:
    lower, upper = tails(words)
    return np.where(lower < upper, special.ndtri(lower), -special.ndtri(upper))


@pytest.mark.parametrize("q", [0.7, 1.0, 100.0, 30_000.0])
def test_shot_noise_is_the_gamma_quantile_of_the_word(q: float) -> None:
    drawn, (lower, upper) = draw_all(law_of(q), WORDS), tails(WORDS)
    above = drawn > 2 * LEAST
    assert np.allclose(stats.gamma(q).cdf(drawn[above]), lower[above], rtol=1e-9, atol=0)
    assert np.allclose(stats.gamma(q).sf(drawn[above]), upper[above], rtol=1e-9, atol=0)
    assert above.sum() > 40


@pytest.mark.parametrize(("sigma", "shot"), [(0.0, True), (7.0, False), (7.0, True)])
def test_the_table_of_the_exact_tier_is_this_law_rounded(sigma: float, shot: bool) -> None:
    words = np.random.default_rng(2).integers(0, 2**32, 20_000, dtype=np.uint32)
    table = threshold(interval_table(200.0, sigma, shot), words) / ONE
    exact = draw_all(law_of(200.0, sigma, shot), words)
    spread = np.hypot(np.sqrt(200) * shot, sigma)
    assert np.abs(table - exact).max() < 1e-4 * spread


@pytest.mark.parametrize("q", [5.0, 20.0, 1000.0, 30_000.0])
def test_the_table_of_gamma_quantiles_agrees_with_their_inverse(q: float) -> None:
    words = np.random.default_rng(3).integers(0, 2**32, 20_000, dtype=np.uint32)
    words = np.concatenate([words, WORDS])
    lower, upper = tails(words)
    inverse = np.where(lower < upper, special.gammaincinv(q, lower), special.gammainccinv(q, upper))
    law = law_of(q)
    assert law.table.size > 2
    assert np.abs(draw_all(law, words) / inverse - 1).max() < 1e-13


def test_without_noise_it_is_the_threshold() -> None:
    assert (draw_all(law_of(12.5, 0.0, False), WORDS) == 12.5).all()


@pytest.mark.parametrize("sigma", [0.4, pytest.param(1.0, marks=pytest.mark.slow)])
def test_one_electron_with_noise_is_the_exponential_plus_normal_law(sigma: float) -> None:
    # Gamma(1) + Normal(0, sigma) is known in closed form.
    drawn, (lower, upper) = draw_all(law_of(1.0, sigma), WORDS), tails(WORDS)
    law = stats.exponnorm(1 / sigma, 0, sigma)
    above = drawn > 1e-6
    low, high = above & (lower < 0.5), above & (lower >= 0.5)
    assert np.allclose(law.cdf(drawn[low]), lower[low], rtol=1e-7, atol=1e-13)
    assert np.allclose(law.sf(drawn[high]), upper[high], rtol=1e-7, atol=0)
    assert above.sum() > 30


@pytest.mark.parametrize(("q", "sigma"), [(20.0, 3.0), (100.0, 28.4), (1000.0, 5.8), (3e4, 900.0)])
def test_the_mixed_law_inverts_its_definition(q: float, sigma: float) -> None:
    drawn, (lower, upper) = draw_all(law_of(q, sigma), WORDS[:11]), tails(WORDS[:11])
    for x, below, above in zip(drawn, lower, upper, strict=True):
        if x <= 2 * LEAST:  # held there
            continue
        side, target = (stats.gamma.cdf, below) if below < above else (stats.gamma.sf, above)

        def inside(z: float, side: object = side, x: float = x) -> float:
            return side(x - sigma * z, q) * np.exp(-z * z / 2) / np.sqrt(2 * np.pi)  # type: ignore[operator]

        knots = np.linspace(-12, 12, 13)
        found = sum(
            integrate.quad(inside, a, b, epsabs=1e-24, epsrel=1e-11)[0]
            for a, b in itertools.pairwise(knots)
        )
        assert found == pytest.approx(target, rel=1e-8)


def test_every_node_of_the_mixed_law_is_inverted() -> None:
    """Newton's method once left a node that it had found, where its step rounded to nothing."""
    rng = np.random.default_rng(4)
    found = [(7752.018398279993, 2.890883294491837), (1725.5112441333442, 0.25054658676940145)]
    for _ in range(40):
        q = 10 ** rng.uniform(-0.5, 5)
        found.append((q, np.sqrt(q) * 10 ** rng.uniform(-3, 1)))
    for q, sigma in found:
        nodes = np.linspace(-6.5, 6.5, 261)
        lower, upper, _ = mixed_law(q, sigma, mixed_quantiles(q, sigma, nodes))
        score = np.where(lower < upper, special.ndtri(lower), -special.ndtri(upper))
        assert np.abs(score - nodes).max() < 1e-7, (q, sigma)


@pytest.mark.parametrize(("q", "sigma"), [(50.0, 20.0), (1000.0, 6.0), (18_725.0, 90.0)])
def test_reading_between_nodes_costs_1e_9_of_the_spread(q: float, sigma: float) -> None:
    order = np.argsort(scores(WORDS))
    exact = np.maximum(mixed_quantiles(q, sigma, scores(WORDS)[order]), LEAST)
    found = draw_all(law_of(q, sigma), WORDS[order])
    assert np.abs(found - exact).max() < 1e-9 * np.hypot(np.sqrt(q), sigma)


@pytest.mark.parametrize(("q", "sigma"), [(1.0, 0.0), (300.0, 0.0), (1000.0, 5.8), (20.0, 2.0)])
def test_what_the_law_says_of_its_own_error_is_small_and_sees_a_wrong_one(q, sigma):
    words = np.random.default_rng(1).integers(0, 2**32, 256, dtype=np.uint32)
    law = law_of(q, sigma)
    assert 0 < law_error(law, words) < 1e-9
    if law.table.size > 2:  # a table of another law is off by that
        other = replace(law, table=law.table * (1 + 1e-6))
        assert law_error(other, words) == pytest.approx(1e-6, rel=0.01)
