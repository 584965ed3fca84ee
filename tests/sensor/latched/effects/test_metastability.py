"""Metastability: the closed form's rate, and draws that depend on their spike alone."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from cosim import PS, Clock
from sensor.latched.effects.metastability import Metastability

N = 1_000_000
PIXELS = (np.arange(N) % 1000).astype(np.uint32)
SPIKES = (np.arange(N) // 1000).astype(np.uint64)


@pytest.mark.parametrize("clock", [Clock(40_000), Clock(10_000_000), Clock(85_000_000)])
@pytest.mark.parametrize("decays", [0.0, 1.0, 4.0])
def test_the_share_is_the_closed_forms(clock: Clock, decays: float) -> None:
    instants = np.random.default_rng(3).integers(0, 10**15, N)
    latch = Metastability(0.2 / clock.hz, decays * 30e-12, 30e-12)
    found = latch.undecided(instants, clock, PIXELS, SPIKES, 5)
    p = 0.2 * math.exp(-decays)
    assert latch.share(clock) == pytest.approx(p)
    assert abs(found.sum() - N * p) < 4.9 * math.sqrt(N * p * (1 - p))


@pytest.mark.parametrize("clock", [Clock(40_000), Clock(60), Clock(85_000_000)])
def test_the_window_lies_around_every_edge(clock: Clock) -> None:
    half = Fraction(1, 20) * PS * clock.period  # a tenth of the cycle in all
    latch = Metastability(float(2 * half / PS), 0.0, 1e-10)
    for k in (0, 1, 7, 10**6 + 1):
        shares = (-2, Fraction(-9, 10), 0, Fraction(9, 10), 2)
        at = [clock.edge(k) + math.floor(share * half) for share in shares]
        found = latch.undecided(np.array(at), clock, PIXELS[:5], SPIKES[:5], 1)
        assert found.tolist() == [False, True, True, True, False]


def test_a_draw_depends_on_pixel_spike_and_seed_alone() -> None:
    clock, latch = Clock(40_000), Metastability(1.0, 30e-12, 30e-12)
    instants = np.zeros(N, np.int64)
    found = latch.undecided(instants, clock, PIXELS, SPIKES, 5)
    order = np.random.default_rng(1).permutation(N)[:1000]
    part = latch.undecided(instants[order], clock, PIXELS[order], SPIKES[order], 5)
    assert np.array_equal(part, found[order])
    p = math.exp(-1)
    shifts = [(PIXELS + np.uint32(1), SPIKES, 5), (PIXELS, SPIKES + np.uint64(2**32), 5)]
    for pixels, spikes, seed in (*shifts, (PIXELS, SPIKES, 6)):
        other = latch.undecided(instants, clock, pixels, spikes, seed)
        both = (found & other).mean()
        assert abs(both - p * p) < 4.9 * math.sqrt(p * p / N)


def test_the_share_of_a_fast_latch_is_small() -> None:
    latch, clock = Metastability(20e-12, 500e-12, 25e-12), Clock(40_000)
    assert latch.share(clock) == pytest.approx(20e-12 * 40e3 * math.exp(-20))


def test_limits_are_refused() -> None:
    bad = (-1.0, 0.0, 1.0), (0.0, -1.0, 1.0), (0.0, 0.0, 0.0), (math.nan, 0.0, 1.0)
    for window, time, tau in bad:
        with pytest.raises(ValueError, match="window and resolution_time must be"):
            Metastability(window, time, tau)
    with pytest.raises(ValueError, match="instants must stay below"):
        late = np.array([2**62])
        Metastability(1e-9, 0, 1).undecided(late, Clock(85_000_000), PIXELS[:1], SPIKES[:1], 1)
