"""The detectors side by side on the sensor's pixel: the figures known, and what joint decision
gains."""

from __future__ import annotations

import pytest

from link.detect.comparison import Compared, comparison

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows() -> dict[str, Compared]:
    return {row.what: row for row in comparison(size=192, symbols=80)}


def _within(row: Compared, rate: float) -> bool:
    return row.low <= rate <= row.high


def test_one_pixel_errs_as_its_background_says(rows: dict[str, Compared]) -> None:
    # Charge kept modulo the threshold is uniform, whatever the data: an off tick spikes with
    # probability b, an on tick always but for some 1e-7; half of the ticks are off.
    assert _within(rows["threshold, one pixel, one tick"], 0.05)


def test_forward_backward_gains_nothing_on_random_data(rows: dict[str, Compared]) -> None:
    slow, plain = (
        rows[f"{name}, one pixel, one tick"] for name in ("forward-backward", "threshold")
    )
    assert slow.low < plain.high and plain.low < slow.high


def test_forward_backward_gains_a_little_on_manchester(rows: dict[str, Compared]) -> None:
    slow, plain = (rows[f"{name}, Manchester"] for name in ("forward-backward", "threshold"))
    assert slow.high < plain.low
    assert 0.7 < slow.rate / plain.rate < 0.9


def test_four_pixels_err_where_all_four_spike_in_the_dark(rows: dict[str, Compared]) -> None:
    assert _within(rows["joint, 2 x 2 pixels"], 0.1**4 / 2)


def test_joint_decision_makes_a_hundred_times_fewer_errors(rows: dict[str, Compared]) -> None:
    for what in ("joint, 2 x 2 pixels", "joint, two ticks"):
        gained = rows[what].gain_low
        assert gained is not None and gained >= 100
