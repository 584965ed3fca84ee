"""The law of a pixel's spikes under light that changes, held against its charge's exact chain."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammaincc

from link.theory import hard_patterns
from link.theory.charge import charge_kernels
from link.theory.patterns import survival


@pytest.mark.parametrize("q", [50, 1000])
def test_survival_is_the_gamma_law_of_the_threshold(q):
    mean = np.linspace(0.8, 1.25, 40)
    assert survival(mean, q) == pytest.approx(gammaincc(q, mean * q), abs=2e-4)
    tail = np.array([1 - 4 / np.sqrt(q), 1 + 4 / np.sqrt(q)])
    exact = gammaincc(q, tail * q)
    assert np.log(survival(tail[1:], q)) == pytest.approx(np.log(exact[1:]), abs=0.2)
    assert survival(1.0, q, 0.0) > survival(1.05, q, 0.0)
    # a noisy threshold: of an interval's law, the variances of both add up
    assert survival(1.1, q, 0.1 * q) > 10 * survival(1.1, q) or q < 100


def test_patterns_are_those_of_the_charges_chain():
    q, window = 60, 4
    light = np.random.default_rng(2).uniform(0.0, 1.4, (5, 7))
    found = hard_patterns(light, window, q)
    assert found.sum(axis=-1) == pytest.approx(np.ones(5), abs=1e-12)
    for row, law in zip(light, found, strict=True):
        state = {0: np.eye(q)[0]}
        for tick, mean in enumerate(row):
            kernel = charge_kernels("hard", q, mean * q)
            at, after = tick - (len(row) - window), {}
            for seen, charge in state.items():
                for spike in (0, 1):
                    told = seen | (spike << at) if at >= 0 else 0
                    after[told] = after.get(told, 0) + charge @ kernel[spike]
            state = after
        exact = np.array([state[n].sum() for n in range(1 << window)])
        assert law == pytest.approx(exact, abs=4e-4)


def test_a_window_longer_than_the_light_is_refused():
    with pytest.raises(ValueError, match="window must be 1 to the 3 ticks"):
        hard_patterns(np.ones((2, 3)), 4, 100)
