"""Log tails against closed forms and exact sums, near and tens of thousands of deviations away."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats
from scipy.special import gammaincc, gammaln

from sensor.asynchronous.pixel.logtails import log_between, log_counts, log_lower, log_upper


def test_of_one_electron_the_tails_are_exponential():
    x = np.array([1e-300, 1e-9, 0.3, 20.0, 600.0, 1e5, 1e12])
    assert log_upper(1.0, x) == pytest.approx(-x, rel=1e-12)
    assert log_lower(1.0, x) == pytest.approx(np.log(-np.expm1(-x)), rel=1e-12, abs=1e-300)
    assert log_lower(5.0, np.zeros(1))[0] == -math.inf


@pytest.mark.parametrize("q", [2, 7, 40])
def test_far_tails_are_the_poisson_s_sums(q):
    """P(Poisson(x) < q) term by term, in logarithms."""
    x = np.array([900.0, 1e4, 1e8])
    k = np.arange(q)
    terms = k * np.log(x[:, None]) - x[:, None] - gammaln(k + 1.0)
    assert log_upper(float(q), x) == pytest.approx(np.logaddexp.reduce(terms, axis=1), rel=1e-11)
    small = np.array([1e-200, 1e-140, 1e-20])
    # x^q / q! (1 - q x / (q + 1) ...)
    assert log_lower(float(q), small) == pytest.approx(q * np.log(small) - math.lgamma(q + 1.0))


@pytest.mark.parametrize("q", [300.0, 3e4, 1e6, 2097151.0])
def test_the_fraction_joins_what_scipy_still_reaches(q):
    """Slopes too: d log P/dx is the hazard, density over tail, on both sides of where one formula
    takes over from the other."""
    for tail, sign, side in ((log_upper, -1, 1), (log_lower, 1, -1)):
        x = np.maximum(q + side * np.linspace(20, 300, 4001) * math.sqrt(q), q * 0.01)
        x = np.unique(x)
        found = tail(q, x)
        assert np.isfinite(found).all() and (np.diff(found) * sign > 0).all()
        # By parts, the tail of q + 1 differs from that of q by density x (x/q).
        term = q * np.log(x) - x - math.lgamma(q + 1.0)
        more = tail(q + 1.0, x)
        # Measured in the larger of the two, so that what the difference leaves is its error.
        whole = np.logaddexp(found, term) if side > 0 else np.logaddexp(more, term)
        assert whole == pytest.approx(more if side > 0 else found, abs=1e-12 * q + 1e-10)


def test_intervals_and_counts_add_up():
    """The law's parts sum to one, and to the tail they part."""
    edges = np.linspace(0, 1000, 101)
    whole = np.exp(log_between(300.0, edges[:-1], edges[1:]))
    assert whole.sum() == pytest.approx(1, abs=1e-13)
    far = np.linspace(2000.0, 9000.0, 2001)
    parts = log_between(300.0, far[:-1], far[1:])
    assert np.logaddexp.reduce(parts) == pytest.approx(log_upper(300.0, far[:1])[0], rel=1e-12)
    low = np.linspace(0.0, 50.0, 501)
    parts = log_between(300.0, low[:-1], low[1:])
    assert np.logaddexp.reduce(parts) == pytest.approx(log_lower(300.0, low[-1:])[0], rel=1e-12)
    mean = np.array([1e-3, 30.0, 400.0, 3e4])
    parts = np.array([log_counts(mean, k, k + 9) for k in range(0, 1000, 10)])
    assert np.logaddexp.reduce(parts) == pytest.approx(
        log_upper(1000.0, mean), rel=1e-11, abs=1e-12
    )
    near = log_counts(np.array([31.0]), 30, 33)[0]
    assert near == pytest.approx(math.log(stats.poisson.pmf(np.arange(30, 34), 31.0).sum()))
    assert log_upper(300.0, np.array([320.0]))[0] == pytest.approx(math.log(gammaincc(300, 320)))
