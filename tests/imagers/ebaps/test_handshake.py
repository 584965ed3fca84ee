"""The hand-shake between the two FPGAs: nothing is lost, times and rates by the closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imagers.ebaps.board.cameralink import LINK_HZ, LinkTiming
from imagers.ebaps.board.handshake import (
    FIFO_VALUES,
    answer_ps,
    hand_over,
    values_a_second,
)


def picture(shape: tuple[int, int], seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 65_536, shape, np.uint16)


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(st.integers(1, 12), st.integers(1, 80)),
    st.tuples(st.integers(10, 200), st.integers(10, 200)),
    st.integers(0, 20_000), st.integers(0, 2**31 - 1),
)  # fmt: skip
def test_every_value_arrives_at_any_clocks(
    shape: tuple[int, int], mhz: tuple[int, int], phase: int, seed: int
) -> None:
    image = picture(shape, seed)
    done = hand_over(image, *(f * 10**6 for f in mhz), phase_ps=phase, seed=seed)
    assert done.image is not None and np.array_equal(done.image, image)
    assert done.overflows == 0 and done.most <= FIFO_VALUES


@pytest.mark.parametrize("phase", range(1, 11_764, 1300))
def test_an_answer_takes_two_to_four_periods_of_each_clock(phase: int) -> None:
    """Two flip-flops each way, and what remains of a period (two, where a sample fell badly)."""
    done = hand_over(picture((6, 30)), LINK_HZ, LINK_HZ, phase_ps=phase, seed=phase)
    low, high = answer_ps(LINK_HZ, LINK_HZ)
    assert (low, high) == pytest.approx((47_059, 94_118), abs=1)
    # REQ falls with a line's last value; the slave's answers are the same both ways.
    assert len(done.answers) >= 11
    assert low - 1 <= min(done.answers) and max(done.answers) <= high + 1


def test_a_line_takes_its_values_and_an_answer() -> None:
    done = hand_over(picture((5, 500)), LINK_HZ, LINK_HZ, phase_ps=5000)
    low, high = answer_ps(LINK_HZ, LINK_HZ)
    sent = 499 * 1e12 / LINK_HZ  # the first value goes with the answer
    assert all(sent + low - 2 <= ps <= sent + high + 2 for ps in done.stored)


def test_a_slower_slave_makes_the_master_wait() -> None:
    done = hand_over(picture((12, 800)), LINK_HZ, LINK_HZ // 4)
    assert done.image is not None and done.overflows == 0
    assert max(done.answers) > answer_ps(LINK_HZ, LINK_HZ // 4)[1]
    rate = 12 * 800 * 1e12 / done.ps
    assert 0.95 * LINK_HZ / 4 < rate < LINK_HZ / 4


def test_a_value_at_a_time_would_be_too_slow() -> None:
    need = LinkTiming().pixel_rate
    assert values_a_second(LINK_HZ, LINK_HZ, 1)[1] < need / 4
    assert values_a_second(LINK_HZ, LINK_HZ, 1280)[0] > 2 * need
    measured = [hand_over(picture((90, 1)), LINK_HZ, LINK_HZ, phase_ps=p) for p in (1, 6000)]
    low, high = values_a_second(LINK_HZ, LINK_HZ, 1)
    for done in measured:
        assert low / 1.2 < 90e12 / done.ps < high * 1.02  # a period more between lines


def test_lines_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 2040 values, not 2041"):
        hand_over(picture((1, 2041)), LINK_HZ, LINK_HZ)
