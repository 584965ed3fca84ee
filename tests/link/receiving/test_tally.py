"""Passes over soft values, beside numpy."""

from __future__ import annotations

import numpy as np
import pytest

from link.receiving.tally import decide, tally


@pytest.mark.parametrize("cells", [1, 2047, 5000])
def test_the_sums_are_those_of_numpy(cells: int) -> None:
    rng = np.random.default_rng(1)
    soft = rng.normal(0, 12, (9, cells)).astype(np.float32)
    quality = rng.random(cells)
    expected = quality + np.abs(soft.astype(np.float64)).sum(axis=0)
    wrong = tally(soft, quality)
    assert quality == pytest.approx(expected, rel=1e-12)
    exact = (1 / (1 + np.exp(np.abs(soft.astype(np.float64))))).sum()
    assert wrong == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize("size", [0.0, 1e-7, 0.3466, 0.3467, 1.0, 17.0, 40.0, 79.9])
def test_a_chance_is_exact_in_float32(size: float) -> None:
    exact = 1 / (1 + np.exp(np.float64(np.float32(size))))
    assert tally(np.float32([[size]]), np.zeros(1)) == pytest.approx(exact, rel=3e-6)
    assert tally(np.float32([[-size]]), np.zeros(1)) == pytest.approx(exact, rel=3e-6)


@pytest.mark.parametrize("symbols", [0, 1, 9])
def test_scale_and_decisions_are_those_of_numpy(symbols: int) -> None:
    soft = np.random.default_rng(1).normal(0, 12, (symbols, 2050)).astype(np.float32)
    soft[:, 0] = 0  # nothing received: off
    expected = soft * np.float32(0.7)
    decided = decide(soft, 0.7)
    assert decided.dtype == np.bool_
    assert (soft == expected).all()
    assert (decided == (expected > 0)).all()


def test_certain_values_promise_nothing() -> None:
    for sure in (100.0, np.inf):
        assert 0 <= tally(np.full((3, 4), sure, np.float32), np.zeros(4)) < 1e-30
