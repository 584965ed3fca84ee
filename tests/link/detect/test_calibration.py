"""Soft values that promise too much are found out, and made to say how often they are wrong."""

from __future__ import annotations

import numpy as np
import pytest

from link.detect.calibration import scaling_factor

N = 200_000


@pytest.mark.parametrize("factor", [1.0, 0.7, 0.4])
def test_the_factor_is_the_one_that_the_values_were_blown_up_by(factor):
    rng = np.random.default_rng(3)
    true = rng.normal(0, 3, N)  # a value's own chance of on is 1 / (1 + e^-L)
    known = rng.random(N) < 1 / (1 + np.exp(-true))
    said = (true / factor).astype(np.float32)
    found = scaling_factor(said, known)
    p = 1 / (1 + np.exp(-np.abs(true)))
    deviation = factor / np.sqrt((true**2 * p * (1 - p)).sum())
    assert abs(found - factor) < 5 * deviation + 1e-3
    wrong = (said > 0) != known
    promise = 1 / (1 + np.exp(np.abs(found * said)))
    assert promise.mean() == pytest.approx(wrong.mean(), abs=5 * np.sqrt(wrong.mean() / N))


def test_values_without_errors_stay_as_they_are():
    known = np.random.default_rng(4).random(1000) < 0.5
    assert scaling_factor(np.where(known, 9, -9).astype(np.float32), known) == 1.0
