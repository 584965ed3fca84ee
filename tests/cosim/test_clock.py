"""Clocks: each edge is the exact rational rounded down, beyond the precision of floats."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.clock import PS, Clock, seconds_to_ps

CLOCKS = {
    "60 Hz": Clock(60),
    "85 MHz": Clock(85_000_000),
    "29.97 Hz": Clock(2997, 100),
    "40 kHz": Clock(40_000),
}
clocks = st.builds(Clock, st.integers(1, 10**15), st.integers(1, 10**15))
cycles = st.integers(-(10**15), 10**15)


def test_first_edges_are_those_worked_by_hand() -> None:
    assert [CLOCKS["60 Hz"].edge(k) for k in (0, 1, 2, 3)] == [
        0, 16_666_666_666, 33_333_333_333, 50_000_000_000,
    ]  # fmt: skip
    assert [CLOCKS["85 MHz"].edge(k) for k in (1, 2, 17)] == [11_764, 23_529, 200_000]
    assert CLOCKS["29.97 Hz"].edge(1) == 33_366_700_033
    assert CLOCKS["40 kHz"].edge(3) == 75_000_000
    assert CLOCKS["60 Hz"].edge(-1) == -16_666_666_667


@pytest.mark.parametrize("clock", CLOCKS.values(), ids=CLOCKS)
@pytest.mark.parametrize("k", [1, 10**6 + 1, 10**9 + 7, 10**12 + 39, 10**15 - 1, 10**15])
def test_edges_are_exact_far_out(clock: Clock, k: int) -> None:
    assert clock.edge(k) == floor(k * Fraction(PS) * clock.den / clock.num)
    assert clock.edge(k) <= k * clock.period * PS < clock.edge(k) + 1


@pytest.mark.parametrize("clock", CLOCKS.values(), ids=CLOCKS)
def test_whole_seconds_come_after_whole_numbers_of_cycles_for_ever(clock: Clock) -> None:
    for seconds in (1, 3600, 10**9):
        assert clock.edge(seconds * clock.num) == seconds * clock.den * PS


@given(clocks, cycles)
def test_cycles_join_and_differ_by_at_most_a_picosecond(clock: Clock, k: int) -> None:
    length = clock.edge(k + 1) - clock.edge(k)
    assert abs(length - clock.period * PS) < 1


@given(clocks, st.integers(-(10**18), 10**18))
def test_cycle_at_is_the_last_cycle_begun(clock: Clock, ps: int) -> None:
    k = clock.cycle_at(ps)
    assert clock.edge(k) <= ps < clock.edge(k + 1)


@given(st.builds(Clock, st.integers(1, 10**12), st.integers(1, 10**12)), cycles)
def test_cycle_at_finds_every_edge_again(clock: Clock, k: int) -> None:
    # Up to 1 THz no two edges share a picosecond.
    if clock.num <= PS * clock.den:
        assert clock.cycle_at(clock.edge(k)) == k
        assert clock.cycle_at(clock.edge(k) - 1) == k - 1


@given(clocks, cycles)
def test_position_is_the_inverse_of_edge_within_a_picosecond(clock: Clock, k: int) -> None:
    late = (k - clock.position(clock.edge(k))) * clock.period * PS
    assert 0 <= late < 1


@given(clocks, cycles)
def test_middle_is_half_way(clock: Clock, k: int) -> None:
    assert clock.middle(k) == floor((k + Fraction(1, 2)) * clock.period * PS)


@pytest.mark.parametrize(
    ("duration", "clock", "count"),
    [
        ("64 ms at 40 kHz", Clock(40_000), 2560),
        ("64 ms at 60 Hz is 3.84 cycles", Clock(60), 4),
        ("64 ms at 20 Hz is 1.28 cycles", Clock(20), 1),
    ],
)
def test_cycles_in_rounds_to_the_nearest(duration: str, clock: Clock, count: int) -> None:
    assert clock.cycles_in(seconds_to_ps(0.064)) == count


@pytest.mark.parametrize(
    ("hz", "clock"),
    [
        (29.97, Clock(2997, 100)),
        (40_000, Clock(40_000)),
        (85e6, Clock(85_000_000)),
        (0.1, Clock(1, 10)),
        (1e-3, Clock(1, 1000)),
    ],
)
def test_from_hz_reads_the_decimal_text(hz: float, clock: Clock) -> None:
    assert Clock.from_hz(hz) == clock
    assert Clock.from_hz(hz).hz == hz


@pytest.mark.parametrize("hz", [0.0, -1.0, float("nan"), float("inf"), -float("inf")])
def test_a_frequency_that_is_none_is_refused(hz: float) -> None:
    with pytest.raises(ValueError, match="clock frequency must be positive and finite, not"):
        Clock.from_hz(hz)


@pytest.mark.parametrize(("num", "den"), [(0, 1), (-60, 1), (60, 0), (60, -1)])
def test_a_clock_that_does_not_run_is_refused(num: int, den: int) -> None:
    with pytest.raises(ValueError, match=f"must be positive, not {num}/{den} Hz"):
        Clock(num, den)


def test_equal_frequencies_are_equal_clocks() -> None:
    assert Clock(80_000, 2) == Clock(40_000)
    assert hash(Clock(5994, 200)) == hash(Clock(2997, 100))


def test_seconds_to_ps_reads_the_decimal_text() -> None:
    # 0.1 + 0.2 as a float is 0.30000000000000004; 0.064 and 1e-12 are no binary fractions.
    assert seconds_to_ps(0.064) == 64_000_000_000
    assert seconds_to_ps(1e-12) == 1
    assert seconds_to_ps(0.1 + 0.2) == 300_000_000_000
    assert seconds_to_ps(1e6 + 1e-6) == 10**18 + 10**6
