"""Short-term plasticity: the published recurrence written out plainly, and its fixed point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cosim import Clock, InputError, Viform
from sensor.reconstruct.plasticity import TAU_F, F, tfstp

CLOCK = Clock(40_000)


def by_definition(bits: np.ndarray, at: int, window: int) -> float:
    """The rate of one pixel: R and u from spike to spike, the last interval being the one that
    holds the instant, or the nearest."""
    fired = np.flatnonzero(bits)
    if fired.size < 2:
        return 0.0
    last = min(max(int(np.searchsorted(fired, at)), 1), fired.size - 1)
    begin = int(fired[last - 1])
    taken = [int(c) for c in fired if max(at + 1 - window, 0) <= c <= min(begin, at)]
    intervals = [*np.diff(taken), int(fired[last]) - begin]
    resources, use = 1.0, 0.15
    for tau in intervals:
        resources = 1 - (1 - resources * (1 - use)) * math.exp(-tau / 1.0)
        use, before = 0.15 + (use + 0.15 * (1 - use) - 0.15) * math.exp(-tau / 10.0), use
        assert use > 0.15 or before == use
    by_r = -1 / math.log((1 - resources) / (1 - resources * (1 - use)))
    by_u = -1 / (10 * math.log((use - 0.15) / (0.15 - 0.15 + use * (1 - 0.15))))
    return (by_r + by_u) / 2


@settings(max_examples=100, deadline=None)
@given(
    hnp.arrays(
        np.uint8,
        st.tuples(st.integers(1, 90), st.integers(1, 3), st.integers(1, 3)),
        elements=st.sampled_from([0, 0, 1]),
    ),
    st.integers(0, 10**6),
    st.integers(1, 100),
)
def test_the_rate_follows_the_recurrence(planes: np.ndarray, pick: int, window: int) -> None:
    planes[::11] = 1  # 1 - R, as the definition has it, is exact to some digits for short intervals
    stream, at = Viform.from_planes(planes, CLOCK), pick % len(planes)
    found, causal = tfstp(stream, at, window), tfstp(stream, at, window, preceding=True)
    for place in np.ndindex(planes.shape[1:]):
        column = planes[(slice(None), *place)]
        assert found[place] == pytest.approx(by_definition(column, at, window), rel=1e-4)
        before = by_definition(column[: at + 1], at, window)
        assert causal[place] == pytest.approx(before, rel=1e-4)


@pytest.mark.parametrize("tau", [1, 2, 3, 7, 20, 64, 300])
def test_constant_light_has_its_own_rate(tau: int) -> None:
    planes = np.zeros((60 * tau, 2, 3), np.uint8)
    planes[tau // 2 :: tau] = 1
    found = tfstp(Viform.from_planes(planes, CLOCK), 50 * tau, 40 * tau + 40)
    np.testing.assert_allclose(found, 1 / tau, rtol=1e-5)


def test_it_follows_a_step_of_light_and_averages_what_alternates() -> None:
    planes = np.zeros((400, 1, 2), np.uint8)
    planes[:200:8, 0, 0] = planes[200::2, 0, 0] = 1  # 1/8, then 1/2
    planes[::5, 0, 1] = planes[2::5, 0, 1] = 1  # intervals of 2 and 3 cycles: 0.4
    stream = Viform.from_planes(planes, CLOCK)
    steps = [float(tfstp(stream, at)[0, 0]) for at in (190, 202, 210, 250)]
    assert steps == sorted(steps)
    assert steps[0] == pytest.approx(1 / 8, rel=1e-2)
    assert steps[-1] == pytest.approx(1 / 2, rel=1e-2)
    two = [float(tfstp(stream, at)[0, 1]) for at in (301, 304)]
    assert min(two) < 0.4 < max(two) and max(two) - min(two) < (1 / 2 - 1 / 3)


def spike_by_spike(planes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and u after the last plane as SpikeCV's online form has them: whole planes, from rest, with
    a first interval that begins before the stream."""
    resources, use = np.ones(planes.shape[1:]), np.full(planes.shape[1:], 0.15)
    before = np.full(planes.shape[1:], -1.0)
    for cycle, plane in enumerate(planes):
        kept, risen = 1 - resources * (1 - use), use + 0.15 * (1 - use) - 0.15
        tau = cycle - before
        resources = np.where(plane, 1 - kept * np.exp(-tau), resources)
        use = np.where(plane, 0.15 + risen * np.exp(-tau / 10), use)
        before = np.where(plane, cycle, before)
    return resources, use


def rates(resources: np.ndarray, use: np.ndarray, f: float) -> tuple[np.ndarray, np.ndarray]:
    by_r = -1 / np.log((1 - resources) / (1 - resources * (1 - use)))
    by_u = -1 / (10 * np.log((use - 0.15) / (f - 0.15 + use * (1 - 0.15))))
    return by_r, by_u


def test_the_authors_program_has_the_same_image_up_to_one_constant() -> None:
    """Its online form. It has tau_F = 10 where the inverse of the recurrence has f = 0.15."""
    planes = (np.random.default_rng(8).random((300, 12, 16)) < 0.3).astype(np.uint8)
    planes[::9] = 1
    state = spike_by_spike(planes)
    found = tfstp(Viform.from_planes(planes, CLOCK), 299, preceding=True)
    np.testing.assert_allclose(sum(rates(*state, f=0.15)) / 2, found, rtol=1e-5)
    # With the other constant the rate of u is nearly one number, and the image is that of R alone.
    by_u = rates(*state, f=10.0)[1]
    assert by_u.min() > 0.015 and by_u.max() < 0.035


@pytest.mark.parametrize(("tau", "factor"), [(2, 1.059), (5, 1.121), (12, 1.228)])
def test_that_program_has_another_rate_for_constant_light(tau: int, factor: float) -> None:
    planes = np.zeros((40 * tau + 1, 1, 1), np.uint8)
    planes[::tau] = 1
    state = spike_by_spike(planes)
    assert sum(rates(*state, f=0.15))[0, 0] / 2 == pytest.approx(1 / tau, rel=1e-6)
    assert sum(rates(*state, f=10.0))[0, 0] * tau == pytest.approx(factor, abs=1e-3)


def test_a_window_without_cycles_is_refused() -> None:
    stream = Viform.from_planes(np.ones((50, 1, 1), np.uint8), CLOCK)
    with pytest.raises(InputError, match="--window must be at least 1, not 0"):
        tfstp(stream, 10, 0)
    with pytest.raises(InputError, match="--at must be a cycle from 0 to 49"):
        tfstp(stream, 50)


def test_the_memory_outlasts_the_rest_state() -> None:
    """At a spike a cycle u forgets by (1 - f) exp(-1 / tau_F) an interval."""
    assert ((1 - F) * math.exp(-1 / TAU_F)) ** 161 < 1e-15
