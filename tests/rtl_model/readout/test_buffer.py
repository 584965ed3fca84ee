"""The buffer behind the row scan against closed forms and against exact fractions.

Rows of L = 1024 bit come every tau = 25 ns; the link takes b bit/s from a buffer of B bytes.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock
from rtl_model.readout import BIT_RATE
from rtl_model.readout.buffer import ROW_PS, Needs, RowBuffer, needed_buffer, needed_rate
from rtl_model.readout.scan import ScanTiming, Window

L = 1024
FULL, HALF = ScanTiming(Clock(40_000)), ScanTiming(Clock(20_000))
"""The chip without a blank time, and with one as long as its scan."""
GBIT = 10**9


@pytest.mark.parametrize("rate", [20 * GBIT, 30 * GBIT, 40 * GBIT, 40_959_999_000])
@pytest.mark.parametrize("size", [256, 1000, 128_000])
def test_an_overloaded_buffer_delivers_its_content_and_what_the_link_carries(
    rate: int, size: int
) -> None:
    """While the link is busy, (B + b t) / L rows have been accepted by the start t of a row."""
    rows = 12_000
    buffer = RowBuffer(FULL, rate, size)
    kept, fill = buffer.scan(0, rows // 1000)
    second = 10**12  # in ps
    accepted = [
        min(n + 1, (8 * size * second + rate * ROW_PS * n) // (L * second)) for n in range(rows)
    ]
    assert np.cumsum(kept).tolist() == accepted
    assert (buffer.delivered, buffer.lost) == (accepted[-1], rows - accepted[-1])
    if buffer.lost:
        first = int(np.argmin(kept))  # all rows before it have found room
        assert first == (8 * size - L) / (L - Fraction(rate * ROW_PS, 10**12)) // 1 + 1
    assert fill.max() <= size and (not buffer.lost or fill.max() > size - L // 8)


def test_a_blank_time_empties_the_buffer() -> None:
    """At 20 kHz each scan starts with what the link has left: F' = max(0, F + L A - b T)."""
    rate, size = 19 * GBIT, 70_000
    buffer, left = RowBuffer(HALF, rate, size), Fraction(0)
    during, whole = Fraction(rate * 999 * ROW_PS, 10**12), Fraction(rate, 20_000)
    kept, fill = buffer.scan(0, 30)
    for k in range(30):
        accepted = min(1000, (8 * size - left + during) // L)
        assert kept[k].sum() == accepted
        if accepted == 1000:
            assert fill[k] == ceil((left + 1000 * L - during) / 8)
        left = max(Fraction(0), left + L * accepted - whole)
    assert 0 < buffer.lost < buffer.offered


@pytest.mark.parametrize(("size", "fewest"), [(128, 500), (5000, 1), (64_063, 1)])
def test_nothing_is_lost_from_the_needed_rate_on(size: int, fewest: int) -> None:
    """Below it the last row of a scan is lost; each second one if the buffer holds but one."""
    rate = needed_rate(HALF, size)
    for tried, lost in ((rate, 0), (rate - 1000, fewest)):
        buffer = RowBuffer(HALF, tried, size)
        buffer.scan(0, 1)
        assert buffer.lost == lost
    assert needed_rate(FULL, size) == BIT_RATE


def test_the_needed_rate_of_a_large_buffer_is_the_mean_one() -> None:
    """A link that is slower by 20 Mbit/s falls back by 1000 bit a cycle of 50 us, and loses a row
    when they fill what the rows of a scan leave of the buffer."""
    assert needed_rate(HALF, 64_064) == needed_rate(HALF, 70_000) == BIT_RATE // 2
    spare = 8 * 70_000 - (1000 * L - 999 * (L // 2))
    for slower, lost in ((0, False), (20_000_000, True)):
        buffer = RowBuffer(HALF, BIT_RATE // 2 - slower, 70_000)
        buffer.scan(0, spare // 1000 - 1)
        assert not buffer.lost
        buffer.scan(spare // 1000 - 1, 3)
        assert bool(buffer.lost) == lost


def test_nothing_is_lost_with_the_needed_buffer() -> None:
    rate = BIT_RATE * 3 // 4
    size = needed_buffer(HALF, rate)
    assert size == (1000 * L - 999 * L * 3 // 4 + 7) // 8
    for tried, lost in ((size, 0), (size - 1, 10)):
        buffer = RowBuffer(HALF, rate, tried)
        buffer.scan(0, 10)
        assert buffer.lost == lost  # the last row of each scan
    assert needed_buffer(FULL, rate) is None


def test_a_plan_states_what_a_run_loses() -> None:
    needs = Needs.of(RowBuffer(FULL, 30 * GBIT, 128_000), 320, True)
    assert needs.lost_share == 84_626 / 320_000
    assert (needs.needed_bps, needs.needed_buffer_bytes) == (BIT_RATE, None)
    assert (needs.mean_bps, needs.file_bytes) == (BIT_RATE, 320 * 128_000)


def test_a_row_takes_the_time_of_those_before_it() -> None:
    """At the chip's own rate row r is there after (r + 1) tau; over a slower link that loses
    nothing after (r + 1) L / b, and over a faster one no earlier than it ends."""
    for timing, rate, row in (
        (FULL, BIT_RATE, 0.025), (FULL, 10**12, 0.025), (HALF, BIT_RATE // 2, 0.05),
    ):  # fmt: skip
        buffer = RowBuffer(timing, rate, 128_000)
        buffer.scan(0, 100)
        assert not buffer.lost
        least, median, most = buffer.delays_us
        assert (least, most) == pytest.approx((row, 1000 * row), rel=1e-12)
        assert median == pytest.approx(500 * row, rel=5e-4)


def test_a_full_buffer_delays_by_its_content() -> None:
    """The row that fills it waits 8 B / b; it starts at most 999 tau after its latch."""
    rate, size = 30 * GBIT, 128_000
    buffer = RowBuffer(FULL, rate, size)
    buffer.scan(0, 500)
    wait, row = 8e6 * size / rate, 1e6 * L / rate
    most = buffer.delays_us[2]
    assert 999 * 0.025 + wait - row <= most <= 999 * 0.025 + wait
    assert buffer.delays_us[1] == pytest.approx(500 * 0.025 + wait, rel=0.01)


def _exact(timing: ScanTiming, rate: int, size: int, cycles: int):
    """(row kept, delay in ps) of every row, in fractions: the link's time when it is free again."""
    free, told = Fraction(0), []
    each = Fraction(L * 10**12, rate)
    for k in range(cycles):
        for r in range(timing.blocks // 2):
            start = timing.clock.edge(k + 1) + r * ROW_PS
            waiting = max(free - start, 0) / each * L
            fits = waiting + L <= 8 * size
            if fits:
                free = max(free, start) + each
            told.append((fits, max(free, start + ROW_PS) - timing.clock.edge(k + 1)))
    return told


@given(
    hz=st.integers(1_000_000, 9_000_000), rows=st.integers(1, 4),
    rate=st.integers(1000, 60_000_000), size=st.integers(128, 700), cut=st.integers(0, 30),
)  # fmt: skip
def test_any_buffer_is_that_of_exact_fractions(
    hz: int, rows: int, rate: int, size: int, cut: int
) -> None:
    """With clocks whose edges are rounded, and continued from a saved state."""
    timing = ScanTiming(Clock(hz), Window((0, rows - 1)))
    before, buffer = RowBuffer(timing, rate * 1000, size), RowBuffer(timing, rate * 1000, size)
    kept = [before.scan(0, cut)[0]]
    buffer.restore(before.state())
    kept.append(buffer.scan(cut, 30 - cut)[0])
    exact = _exact(timing, rate * 1000, size, 30)
    assert np.concatenate(kept).reshape(-1).tolist() == [fits for fits, _ in exact]
    delays = sorted(ceil(delay) for fits, delay in exact if fits)
    least, median, most = buffer.delays_us
    assert (least, most) == pytest.approx((delays[0] / 1e6, delays[-1] / 1e6), rel=1e-12)
    assert median == pytest.approx(delays[(len(delays) - 1) // 2] / 1e6, rel=5e-4)


def test_what_the_arithmetic_does_not_hold_is_refused() -> None:
    for rate, size in ((1500, 128), (0, 128), (1000, 127), (1000, 10**9 + 1)):
        with pytest.raises(ValueError, match="whole kbit/s and 128 to 1e9 bytes"):
            RowBuffer(FULL, rate, size)
    large = RowBuffer(FULL, 1_000_000, 10**9)  # the largest fill and the slowest link
    large.scan(0, 200)
    assert (large.lost, large.delays_us[2] > 2e8 / 1e6) == (0, True)
