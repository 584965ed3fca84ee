"""Bits that are nearly wrong: what their number says of a bit error rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from link.plan.check import ESTIMATED, FEWEST, KIND, LinkCheck, compare, near
from link.report.tables import error_text

SLOPE, RATE = 0.6, 1e-5


def leads(bits: int, seed: int) -> np.ndarray:
    """Soft values for what was sent of which RATE e^(SLOPE t) lie below t."""
    draws = np.random.default_rng(seed).random(bits)
    return np.asarray(np.log(draws / RATE) / SLOPE, np.float32)


@pytest.mark.parametrize("moved", [0.1, -0.25])
def test_errors_change_by_the_share_that_nearly_wrong_bits_do(moved: float) -> None:
    """Where ln(share below t) is a line, moving all soft values changes it alike at every t."""
    full = leads(10**6, 3)
    run = full - np.float32(moved)
    truth = math.expm1(SLOPE * moved)
    found = near(full, run)
    assert found is not None and found.count == 1000
    assert found.relative[0] <= truth <= found.relative[1]
    assert found.change == pytest.approx(truth, abs=4 * math.sqrt(abs(truth) / 1000))
    paired = compare(full <= 0, run <= 0, 10**8, (full, run))
    assert paired.kind == ESTIMATED and paired.error.low > 0
    assert paired.error.value == pytest.approx(abs(found.change) * (full <= 0).mean() / paired.unit)
    # The same truth is within the limits of what is counted, which are far wider.
    low, high = paired.counted.low, paired.counted.high
    assert low <= abs(truth) * RATE / paired.unit <= high
    assert high - low > 3 * (paired.error.high - paired.error.low)
    met = paired.rescaled(1e-4, 10**7)
    assert met.error.value == pytest.approx(abs(found.change) * 1e-4 / met.unit)
    assert LinkCheck(met, {}, 0.0, 1, 1.0).error(0.0).kind == ESTIMATED
    assert LinkCheck(met, {}, 0.0, 1, 1.0).beyond(met.error.low / 2)


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    """Half of the bits move by one number, the others not: e^(SLOPE d) of a half, 250 times."""
    moved, missed = 0.2, 0
    truth = math.expm1(SLOPE * moved) / 2
    rng = np.random.default_rng(8)
    for seed in range(250):
        full = leads(20_000, seed)
        run = full - np.where(rng.random(full.size) < 0.5, moved, 0).astype(np.float32)
        found = near(full, run)
        assert found is not None
        missed += not found.relative[0] <= truth <= found.relative[1]
    assert missed <= 5  # mean at most 0.25; P(more than 5) < 1e-6


def test_soft_values_of_few_numbers_are_not_parted_by_a_margin_among_them() -> None:
    full = np.rint(leads(300_000, 5) / 2).astype(np.float32) * 2
    found = near(full, full + np.float32(1e-3))
    assert found is not None and abs(found.change) < 0.01
    same = near(full, full)
    assert same is not None and (same.more, same.fewer) == (0, 0)
    assert same.size[0] == 0 < same.size[1] < 0.05


def test_few_bits_or_many_errors_are_counted_only() -> None:
    few = leads(99 * FEWEST, 1)
    assert near(few, few) is None
    paired = compare(few <= 0, few <= 0, 10**6, (few, few))
    assert paired.kind == KIND and paired.error == paired.counted
    many = leads(10**5, 1) - np.float32(math.log(0.01 / RATE) / SLOPE)
    assert (many <= 0).mean() > 5e-3 and near(many, many) is None


def test_the_report_says_which_figure_is_counted_and_which_is_estimated() -> None:
    full = leads(10**5, 3)
    run = full - np.float32(0.1)
    paired = compare(full <= 0, run <= 0, 10**8, (full, run))
    assert paired.near is not None
    told = error_text(LinkCheck(paired, {}, 0.0, 3, 1.0))
    assert "an estimate from 200 bits that are nearly wrong" in told
    assert f"{paired.near.more} more and {paired.near.fewer} fewer" in told
    assert f"between {paired.counted.low:.2g} and {paired.counted.high:.2g}" in told
    alone = error_text(LinkCheck(compare(full <= 0, run <= 0, 10**8), {}, 0.0, 3, 1.0))
    assert "estimate" not in alone and "Counted in this way" in alone
