"""The information of soft values against channels whose mutual information is known."""

from __future__ import annotations

import numpy as np
import pytest

from link.theory.soft_information import soft_information

BITS = 200_000


def sent(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).random(BITS) < 0.5


@pytest.mark.parametrize("wrong", [0.001, 0.01, 0.11, 0.4])
@pytest.mark.parametrize("factor", [0.1, 1.0, 7.0])
def test_a_binary_symmetric_channel_has_its_capacity_whatever_the_factor(
    wrong: float, factor: float
) -> None:
    on = sent()
    got = on ^ (np.random.default_rng(2).random(BITS) < wrong)
    found = soft_information(np.where(got, factor, -factor).astype(np.float32), on)
    capacity = 1 + wrong * np.log2(wrong) + (1 - wrong) * np.log2(1 - wrong)
    assert found is not None and found.low <= capacity <= found.high
    assert found.factor * factor == pytest.approx(np.log(1 / wrong - 1), rel=0.1)


@pytest.mark.parametrize("sigma", [0.4, 0.8, 1.5])
def test_a_gaussian_channel_has_its_mutual_information(sigma: float) -> None:
    """Numerically: 1 - E[log2(1 + exp(-L))], L normal with mean 2 / sigma^2."""
    on, rng = sent(3), np.random.default_rng(4)
    soft = 2 / sigma**2 * (np.where(on, 1.0, -1.0) + sigma * rng.standard_normal(BITS))
    z = np.linspace(-9, 9, 20_001)
    weight = np.exp(-z * z / 2)
    weight /= weight.sum()
    exact = 1 - weight @ np.logaddexp(0, -2 / sigma**2 * (1 + sigma * z)) / np.log(2)
    found = soft_information(soft, on)
    assert found is not None and found.low <= exact <= found.high
    assert found.factor == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("wrong", [0, 1, 5])
def test_few_wrong_values_leave_room_for_those_that_were_not_seen(wrong: int) -> None:
    on = sent()
    right = np.full(BITS, 9.0)
    right[:wrong] = -9.0
    found = soft_information(np.where(on, right, -right), on)
    rate = (wrong + 4) / BITS  # well inside the interval of the error rate
    assert found is not None and found.bits > 0.999
    assert found.low < 1 + rate * np.log2(rate) + (1 - rate) * np.log2(1 - rate)


def test_bits_that_depend_on_each_other_widen_the_interval_by_the_root_of_their_number() -> None:
    """Each value stands in `alike` bits: the mean has the spread of BITS / alike values."""
    alike, on = 100, sent()
    got = np.repeat(np.random.default_rng(5).random(BITS // alike) < 0.05, alike) ^ on
    soft = np.where(got, 3.0, -3.0)
    plain = soft_information(soft, on)
    found = soft_information(soft, on, np.arange(BITS) // alike)
    assert plain is not None and found is not None and found.bits == plain.bits
    wider = (found.high - found.low) / (plain.high - plain.low)
    assert wider == pytest.approx(np.sqrt(alike), rel=0.01)
    with pytest.raises(ValueError, match="at least 2 batches, not 1"):
        soft_information(soft, on, np.zeros(BITS, np.intp))


def test_no_bit_and_no_knowledge() -> None:
    assert soft_information(np.zeros(0), np.zeros(0, bool)) is None
    found = soft_information(np.zeros(100), sent()[:100])
    assert found is not None and found.bits == 0
