"""The laws inside the compiled loops, against scipy and numerical integration."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special, stats

from sensor.asynchronous.pixel.closed import unit
from sensor.asynchronous.pixel.gamma import (
    inverse_lower,
    inverse_upper,
    poisson_below,
    poisson_outside,
    tails,
)
from sensor.asynchronous.pixel.stretches import fitting, geometric, interval_moments, stretch
from sensor.device.charge import crossing, exposure, later


@pytest.mark.parametrize("q", [1.0, 2.0, 30.0, 300.0, 3e4])
@pytest.mark.parametrize("z", [-4, -1, 0, 1, 4, 8])
def test_both_tails_are_right_to_their_own_digits(q, z):
    x = max(q + z * math.sqrt(q), 0.05 * q)
    lower, upper = tails(q, x)
    assert lower == pytest.approx(special.gammainc(q, x), rel=1e-10)
    assert upper == pytest.approx(special.gammaincc(q, x), rel=1e-10)


@pytest.mark.parametrize("q", [1.0, 30.0, 300.0, 3e4])
@pytest.mark.parametrize("drop", [0.01, 1.0, 30.0])
def test_the_tails_invert(q, drop):
    for start in (q, q + 5 * math.sqrt(q)):
        goal = math.log(tails(q, start)[1]) - drop
        assert math.log(tails(q, inverse_upper(q, start, goal))[1]) == pytest.approx(goal, rel=1e-9)
    for start in (q, max(q - 5 * math.sqrt(q), 0.3 * q)):
        goal = math.log(tails(q, start)[0]) - drop
        assert math.log(tails(q, inverse_lower(q, start, goal))[0]) == pytest.approx(goal, rel=1e-9)


@pytest.mark.parametrize(
    ("mean", "q"), [(0.3, 300), (3.0, 5), (40.0, 300), (290.0, 300), (9e3, 10**4)]
)
def test_electrons_below_threshold_are_truncated_poisson(mean, q):
    whole = stats.poisson.cdf(q - 1, mean)
    for u in (1e-9, 0.01, 0.3, 0.5, 0.77, 0.999, 1 - 1e-9):
        k = poisson_below(mean, q, u)
        assert 0 <= k < q
        # The quantile: the first k whose probability reaches u; one in 1e9 for rounding.
        assert stats.poisson.cdf(k, mean) / whole >= u * (1 - 1e-9)
        assert k == 0 or stats.poisson.cdf(k - 1, mean) / whole < u * (1 + 1e-9)


def test_electrons_outside_a_range_are_the_two_tails():
    mean, low, high, q = 20.0, 15, 27, 40
    u = (np.arange(20000) + 0.5) / 20000
    drawn = np.array([poisson_outside(mean, low, high, q, x) for x in u])
    assert not ((drawn >= low) & (drawn <= high)).any()
    k = np.arange(q + 1)
    p = stats.poisson.pmf(k, mean)
    p[q] = stats.poisson.sf(q - 1, mean)
    p[low : high + 1] = 0
    # Evenly spaced quantiles meet each probability to within one of them.
    assert np.abs(np.bincount(drawn, minlength=q + 1) / u.size - p / p.sum()).max() <= 1.01 / u.size


@pytest.mark.parametrize("q", [1.0, 30.0, 300.0])
@pytest.mark.parametrize(
    ("a", "b", "c"), [(-9, 99, -9), (-3, 3, -9), (-2.5, 4, 0), (-9, 3, 1), (-1, 3, 2)]
)
def test_the_moments_of_an_unreported_interval(q, a, b, c):
    """max(G, c) for G between a and b, against quadrature; bounds in standard deviations."""
    low, high, held = (max(q + z * math.sqrt(q), 0.0) for z in (a, b, c))
    high = min(high, q + 40 * math.sqrt(q) + 40)
    law = stats.gamma(q)
    knots = sorted({low, min(max(held, low), high), min(max(q, low), high), high})

    def mean_of(f):
        parts = (
            integrate.quad(lambda g: f(max(g, held)) * law.pdf(g), x, y, epsabs=0, epsrel=1e-11)[0]
            for x, y in pairwise(knots)
        )
        return sum(parts)

    whole = mean_of(lambda g: 1.0)
    mean = mean_of(lambda g: g) / whole
    variance = mean_of(lambda g: (g - mean) ** 2) / whole
    third = mean_of(lambda g: (g - mean) ** 3) / whole
    found = interval_moments(q, low, high, held)
    assert found[0] == pytest.approx(mean, rel=1e-9)
    assert found[1] == pytest.approx(variance, rel=1e-7)
    assert found[2] == pytest.approx(third, rel=1e-6, abs=1e-6 * variance**1.5)


def test_a_stretch_of_plain_intervals_is_gamma():
    n, q, m = 20000, 30.0, 1000
    drawn = [
        stretch(m, q, q, 2 * q, 0.0, np.uint64(p), np.uint64(7), np.uint64(1)) for p in range(n)
    ]
    assert stats.kstest(drawn, "gamma", args=(m * q,)).pvalue > 1e-6


def test_a_stretch_has_the_moments_asked_for():
    n, m, mean, variance, third = 20000, 400, 31.0, 20.0, -60.0
    drawn = np.array(
        [
            stretch(m, mean, variance, third, 0.0, np.uint64(p), np.uint64(7), np.uint64(1))
            for p in range(n)
        ]
    )
    # Standard errors: sd/sqrt(n), and about var sqrt(2/n) and sd^3 sqrt(15/n).
    spread = math.sqrt(m * variance)
    assert drawn.mean() == pytest.approx(m * mean, abs=5 * spread / math.sqrt(n))
    assert drawn.var() == pytest.approx(m * variance, rel=5 * math.sqrt(2 / n))
    around = ((drawn - drawn.mean()) ** 3).mean()
    assert around == pytest.approx(m * third, abs=5 * spread**3 * math.sqrt(15 / n))


@pytest.mark.parametrize("q", [1.0, 300.0])
def test_a_stretch_of_held_intervals_is_never_shorter_than_they_are(q):
    """99 % held: all 256 are with 0.99^256 = 7.6 %, and 0.5 % less than that by the fitted law."""
    n, m, share = 20000, 256, 0.99
    held = special.gammaincinv(q, share)
    law = interval_moments(q, 0.0, math.inf, held)
    drawn = np.array([stretch(m, *law, held, np.uint64(p), np.uint64(7), np.uint64(1))
                      for p in range(n)])  # fmt: skip
    assert drawn.min() == m * held
    atom = share**m
    assert (drawn == m * held).mean() == pytest.approx(
        atom, abs=0.005 + 4.9 * math.sqrt(atom * (1 - atom) / n)
    )
    # The clamp adds little to the mean: less than a tenth of a deviation.
    assert drawn.mean() == pytest.approx(m * law[0], abs=0.1 * math.sqrt(m * law[1]))


def test_the_wait_for_a_report_is_geometric():
    n, p = 20000, 0.003
    drawn = np.array([geometric(p, np.uint64(i), np.uint64(3), np.uint64(2)) for i in range(n)])
    edges = np.quantile(drawn, np.linspace(0, 1, 21)[1:-1])
    edges = np.concatenate([[-1], np.unique(edges), [np.inf]])
    observed = np.histogram(drawn, edges + 0.5)[0]
    law = stats.geom(p, loc=-1)
    expected = np.diff(np.concatenate([[0], law.cdf(edges[1:-1]), [1]])) * n
    assert stats.chisquare(observed, expected).pvalue > 1e-6
    assert geometric(0.0, np.uint64(1), np.uint64(1), np.uint64(1)) == 1 << 62


def test_a_stretch_that_fits_stays_eight_deviations_clear():
    for left, mean, deviation in ((1e6, 100.0, 6.0), (5e3, 100.0, 30.0), (1e15, 1.0, 0.0)):
        m = fitting(left, mean, deviation)
        assert m * mean + 8 * deviation * math.sqrt(m) <= left * (1 + 1e-12)
        m += 1 + m * 1e-9
        assert m * mean + 8 * deviation * math.sqrt(m) > left * (1 - 1e-12)


@given(
    st.just(0.0) | st.floats(1e-30, 1e3),
    st.just(0.0) | st.floats(1e-40, 1e-9) | st.floats(-1e-9, -1e-40),
    st.floats(1e-6, 1e7),
)
def test_the_crossing_brings_exactly_the_charge(rate, slope, need):
    """Over nine decades of rising and falling light: put back, the time gives the charge."""
    x = crossing(rate, slope, need)
    assert x >= 0
    if x == math.inf:
        # It never does: light falls to nothing first, with at most rate^2 / (2 |slope|) gathered.
        assert slope <= 0 and rate * rate <= -2 * slope * need * (1 + 1e-12)
        return
    # Near the top of a falling parabola time is ill-conditioned, the charge is not.
    assert rate * x + slope * x * x / 2 == pytest.approx(need, rel=1e-12)
    assert exposure(rate, slope, x) == pytest.approx(need, rel=1e-12)


def test_a_slow_ramp_loses_nothing_to_cancellation():
    """slope x need / rate^2 = 1e-16: the schoolbook root would give 0."""
    assert crossing(1.0, 1e-16, 1.0) == pytest.approx(1 - 0.5e-16, rel=1e-15)
    assert crossing(0.0, 2e-20, 1.0) == pytest.approx(1e10, rel=1e-14)
    assert crossing(0.0, 0.0, 1.0) == math.inf


def test_time_is_whole_picoseconds_and_a_fraction():
    instant, part = 0, 0.0
    for _ in range(1000):
        instant, part = later(instant, part, 0.1)
    assert instant == 100 or (instant == 99 and part > 1 - 1e-9)
    assert later(10**17, 0.75, 0.5) == (10**17 + 1, 0.25)


def test_uniform_numbers_stay_inside():
    drawn = [unit(np.uint64(p), np.uint64(1), np.uint64(0), np.uint64(1), np.uint64(48))
             for p in range(5000)]  # fmt: skip
    assert min(drawn) > 0 and max(drawn) < 1
    assert stats.kstest(drawn, "uniform").pvalue > 1e-6
