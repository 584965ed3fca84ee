"""Light from widths, readings and silence: closed forms of the likelihood, coverage, and images.

Log tails against closed forms and exact sums, near and tens of thousands of deviations away.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.special import gammaincc, gammaln

from cosim import PS, Clock, Events
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.readout.estimate import (
    Observed,
    estimate_rate,
    log_between,
    log_counts,
    log_lower,
    log_upper,
    mean_rate,
)
from sensor.asynchronous.readout.shots import rate_image


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


NONE = np.zeros(0, np.int64)


def model(threshold: int = 300, shortest: int = 10_000, **more: Any) -> EventModel:
    return EventModel(threshold, 1, more.pop("clock", Clock(10**9)), shortest, **more)


def test_of_fine_widths_the_estimate_is_all_electrons_over_all_time():
    """The Gamma likelihood's maximum is n Q / sum of widths; its curvature is n Q."""
    widths = np.array([1_000_000, 1_100_000, 950_000])
    found = estimate_rate(model(), Observed(widths, NONE, 0, PS))
    expected = 900 / ((widths - 0.5).sum() * 1e-9)
    assert found.rate == pytest.approx(expected, rel=1e-7)
    assert found.high / found.rate == pytest.approx(math.exp(3.2905 / 30), rel=1e-3)


def test_the_comparator_s_delay_is_taken_off():
    widths = np.array([2_000_000])
    found = estimate_rate(model(delay=500_000_000), Observed(widths, NONE, 0, 10 * PS))
    assert found.rate == pytest.approx(300 / ((2_000_000 - 0.5) * 1e-9 - 0.5e-3), rel=1e-7)


def test_of_single_electrons_silence_counts_as_time_waited():
    """Q = 1 is the exponential law: fired / (sum of widths + silent x waited)."""
    widths = np.array([10_000_000, 40_000_000, 90_000_000])
    found = estimate_rate(model(1), Observed(widths, NONE, 7, PS // 10))
    assert found.rate == pytest.approx(3 / (((widths - 0.5).sum()) * 1e-9 + 0.7), rel=1e-6)


def test_of_single_electron_levels_the_estimate_is_the_mean_count():
    """As many levels as electrons, none fired: Poisson, mean count over time."""
    levels = np.array([3, 5, 2, 0, 4])
    found = estimate_rate(model(levels=300, longest=PS // 100), Observed(NONE, levels, 0, PS))
    assert found.rate == pytest.approx(14 / 5 / 0.01, rel=1e-5)


def test_of_silence_alone_there_is_an_upper_limit():
    """P(N < Q)^n at the limit is exp(-CONFIDENCE^2 / 2); for Q = 1 that is n rate T = 5.41."""
    found = estimate_rate(model(1), Observed(NONE, NONE, 20, PS))
    assert found.rate == found.low == 0
    assert found.high == pytest.approx(3.2905**2 / 2 / 20, rel=1e-4)


def test_when_every_width_was_held_there_is_a_lower_limit():
    """A clock of 10 ns and every width one tick: the light may be anything above."""
    coarse = model(clock=Clock(10**8))
    found = estimate_rate(coarse, Observed(np.ones(50, np.int64), NONE, 0, PS))
    assert found.rate == found.high == math.inf
    # 50 of 50 in the first 10 ns: P(Gamma(300) < 10 ns x rate) = exp(-5.41 / 50).
    from scipy.special import gammaincinv

    assert found.low * 1e-8 == pytest.approx(
        gammaincinv(300, math.exp(-(3.2905**2) / 100)), rel=1e-3
    )


@pytest.mark.parametrize(
    ("rate", "rules", "waited"),
    [
        (2.86e10, {}, PS),  # a fifth held at the shortest width
        (2.86e10, {"threshold": 286}, PS),  # half held
        (2.86e10, {"clock": Clock(2 * 10**8)}, PS),  # ticks of 5 ns: held, one more, few later
        (290.0, {}, PS),  # a third fires
        (2.9e2, {"longest": PS // 100, "levels": 100}, PS),  # 2.9 electrons in a reading
        (34.0, {"longest": PS, "levels": 10}, PS),  # 34 electrons, a level each 30
        (5e11, {"threshold": 100_000}, PS),  # 200 ticks, a deviation two thirds of one
        (2e12, {"threshold": 1_000_000}, PS),  # 500 ticks, a deviation half of one
    ],
)
def test_the_estimate_has_no_bias_and_covers_what_it_says(rate, rules, waited):
    """80 patches of 60 pixels drawn from the law itself, not from the simulator: the mean error
    within 4.9 standard errors (plus what 1/electrons bias such a likelihood has), and the 99.9 %
    interval misses at most 4 of 80 (0.08 expected, P = 2e-8 for 5)."""
    setting = model(**rules)
    rng = np.random.default_rng(3)
    q, tick = setting.threshold, setting.tick
    errors, missed, information = [], 0, []
    for _ in range(80):
        tau = rng.gamma(q, 1 / rate, 60) * PS
        fires = tau <= (setting.longest or waited)
        held = np.maximum(tau[fires], setting.shortest)
        widths = np.ceil(held / tick).astype(np.int64)
        levels, silent = NONE, int((~fires).sum())
        if setting.longest:
            counts = rng.poisson(rate * setting.longest / PS, 1000)
            levels, silent = counts[counts < q][:silent] * setting.levels // q, 0
        found = estimate_rate(setting, Observed(widths, levels, silent, waited))
        errors.append(math.log(found.rate / rate))
        missed += not found.low <= rate <= found.high
        information.append(math.log(found.high / found.low) / 2 / 3.2905)
    error, spread = np.array(errors), np.mean(information)
    assert abs(error.mean()) < 4.9 * spread / math.sqrt(80) + spread**2
    # It promises the deviation that it has: alpha 1e-6, two-sided.
    low, high = stats.chi2.ppf([5e-7, 1 - 5e-7], 79) / 79
    assert low < (error.std(ddof=1) / spread) ** 2 < high
    assert missed <= 4


@pytest.mark.parametrize("threshold", [100_000, 300_000, 1_000_000, 2**21 - 1])
def test_of_many_electrons_the_peak_is_found_whatever_the_width(threshold):
    """One pixel, widths of a few ticks to a million: the truth lies within the tick."""
    setting = model(threshold)
    for width in (11, 20, 90, 300, 900, 5_000, 1_000_000):
        found = estimate_rate(setting, Observed(np.full(20, width), NONE, 0, PS))
        # 4.9 deviations of a Gamma law beside the tick itself.
        slack = 4.9 / math.sqrt(20 * threshold)
        assert threshold * 1e9 / width * (1 - slack) < found.rate
        assert found.rate < threshold * 1e9 / (width - 1) * (1 + slack)
        assert 0 < found.low < found.rate < found.high < math.inf


@pytest.mark.parametrize(("fired", "silent"), [(110, 90), (2000, 1), (30_000, 3)])
def test_silence_in_bright_light_still_counts_as_time_waited(fired, silent):
    """Far from what fired, P(N < 1) is exp(-rate waited), and no rate is cut off: Q = 1 has
    fired / (sum of widths + silent x waited)."""
    widths = np.full(fired, 20)
    found = estimate_rate(model(1, 1000), Observed(widths, NONE, silent, PS))
    assert found.rate == pytest.approx(fired / (fired * 19.5e-9 + silent), rel=1e-6)


def test_the_plain_mean_of_floors_misses_what_the_likelihood_finds():
    """2.9 electrons in a reading of levels of 3: the floor loses half of them."""
    setting = model(longest=PS // 100, levels=100)
    counts = np.random.default_rng(1).poisson(2.9, 5000)
    seen = Observed(NONE, counts * 100 // 300, 0, PS)
    assert mean_rate(setting, seen) < 0.7 * 290
    # sqrt(1 / (5000 x 2.9)) of a full count; binning costs less than half of what it tells.
    assert estimate_rate(setting, seen).rate == pytest.approx(290, rel=4.9 * 0.0083 * 1.5)


def test_the_plain_mean_is_of_rates():
    widths = np.array([1_000_000, 500_000])
    seen = Observed(widths, NONE, 3, PS)
    assert mean_rate(model(), seen) == pytest.approx((300 / 1e-3 + 300 / 0.5e-3) / 2)
    assert math.isnan(mean_rate(model(), Observed(NONE, NONE, 3, PS)))
    with pytest.raises(ValueError, match="at least one"):
        estimate_rate(model(), Observed(NONE, NONE, 0, PS))


def test_an_image_takes_the_event_that_holds_the_instant():
    """Pixel 0: widths 100 to tick 99, then 40 to tick 139; pixel 1: one event, silent since; pixel
    2: a reading of level 2 of 4 after 50; pixel 3: a reading of level 0; pixel 4: nothing."""
    events = Events(
        np.array([0, 0, 0, 0, 0], np.uint16),
        np.array([1, 2, 3, 0, 0], np.uint16),
        np.array([9, 49, 49, 99, 139]),
        np.array([10, 50, 50, 100, 40]),
        (1, 5),
        200,
        Clock(10**6),
        level=np.array([4, 2, 0, 4, 4], np.uint16),
        levels=4,
    )
    us = 1e-6
    for tick, first in ((50, 100), (99, 100), (110, 40), (180, 40)):
        image = rate_image(events, tick, 300)
        assert image[0] == pytest.approx(
            [300 / (first * us), 300 / (10 * us), 300 * 2.5 / 4 / (50 * us), 0, 0]
        )
    assert rate_image(events, 5, 300)[0] == pytest.approx(
        [300 / (100 * us), 300 / (10 * us), 300 * 2.5 / 4 / (50 * us), 0, 0]
    )
    late = rate_image(events, 50, 300, delay=5 * us)[0]
    # The comparator answers spikes alone: a reading is taken when the longest width is up.
    assert late[:3] == pytest.approx([300 / (95 * us), 300 / (5 * us), 300 * 2.5 / 4 / (50 * us)])
