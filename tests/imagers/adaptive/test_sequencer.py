"""Resets and samples of the adaptive exposure, to the clock."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imagers.adaptive.device.signals import gray, gray_bits, ring, signal_list, signals_of
from imagers.adaptive.device.timing import Timing, actual_exposures, disturbed, frames_of
from tests.imagers.adaptive.counter_sequencer import CounterSequencer, johnson

SMALL = Timing(rows=6, columns=6, line=28, frame=176, cycle=4, turn=8)
USUAL = Timing.of(256, 256)
LIMIT = 255 << 24
"""Clocks: the largest minimum-exposure register times 2^24."""

small_exposures = st.lists(
    st.one_of(st.integers(1, 400), st.sampled_from([1, 2, 28, 56, 167, 168, 169, 176])),
    min_size=1, max_size=6,
)  # fmt: skip
any_exposures = st.lists(
    st.one_of(
        st.integers(0, 24).map(lambda n: 20 << n), st.integers(1, 600_000), st.just(LIMIT)
    ),
    min_size=1, max_size=30,
)  # fmt: skip


@settings(max_examples=20, deadline=None)
@given(small_exposures)
def test_every_edge_is_that_of_the_sequencer_clock_by_clock(exposures: list[int]) -> None:
    frames = frames_of(SMALL, exposures)
    coming = list(signals_of(SMALL, frames))
    assert [c for c, _, _ in coming] == sorted(c for c, _, _ in coming)
    values = {s.name: s.before for s in signal_list(SMALL)}
    resets, samples, at = [], [], 0
    for tick in CounterSequencer(SMALL, exposures).run():
        while at < len(coming) and coming[at][0] <= tick.clock:
            values[coming[at][1]] = coming[at][2]
            at += 1
        assert tick.signals == values, tick.clock
        resets += [(tick.clock, row) for _, row in tick.resets]
        samples += [] if tick.sampled is None else [(tick.clock, tick.sampled)]
    assert at == len(coming)
    rows = range(SMALL.rows)
    assert sorted(resets) == sorted((f.reset(r), r) for f in frames for r in rows)
    assert samples == [(f.sample(r), r) for f in frames for r in rows]


@settings(max_examples=8, deadline=None)
@given(small_exposures)
def test_counters_step_one_bit_and_in_work_phases_only(exposures: list[int]) -> None:
    before = None
    stepped: set[str] = set()
    for tick in CounterSequencer(SMALL, exposures).run():
        if before is not None:
            for name, code in tick.codes.items():
                bits = (before.codes[name] ^ code).bit_count()
                assert bits <= 1
                if name != "phase":
                    assert not (bits and tick.idle)
                    assert not (bits and tick.signals["sampling"])
                    stepped |= {name} if bits else set()
            assert tick.codes["phase"] != before.codes["phase"]  # the ring that makes the phases
            if tick.signals["sampling"]:
                assert not tick.signals["Pout"] and not tick.signals["select"]
        before = tick
    assert stepped >= {"timer", "columns", "row", "reset1"}


@settings(max_examples=60, deadline=None)
@given(any_exposures)
def test_overlapping_exposures_never_reset_a_row_twice(exposures: list[int]) -> None:
    frames = frames_of(USUAL, exposures)
    made = actual_exposures(USUAL, frames)
    assert (made == np.array(exposures)[:, None]).all()
    for row in (0, 100, 255):  # reset, sample, reset, sample, ... with room to read in between
        edges = [e for f in frames for e in (f.reset(row), f.sample(row))]
        assert edges == sorted(edges) and len(set(edges)) == len(edges)
        gaps = [b - a for a, b in zip(edges[1::2], edges[2::2], strict=False)]
        assert all(gap >= USUAL.turn for gap in gaps)
    for counter in (1, 2):  # each has finished its frame before it begins the next
        own = [f for f in frames if f.counter == counter]
        for a, b in pairwise(own):
            assert b.reset(0) > a.reset(USUAL.rows - 1)
    for a, b in pairwise(frames):
        assert (a.counter == b.counter) == (a.exposure == b.exposure)
        assert b.hold + b.exposure == b.period == b.start - a.start >= USUAL.frame
        assert b.period == USUAL.frame or b.period < b.exposure + USUAL.turn + USUAL.cycle


def test_one_reset_counter_is_not_enough() -> None:
    """A long exposure after a short one: its resets begin while the first counter works."""
    exposures = [20 << 3, 20 << 13, 20 << 3]
    frames = frames_of(USUAL, exposures)
    one = actual_exposures(USUAL, frames, counters=1)
    assert (one[0] != exposures[0]).any()
    assert (one[0, :10] == exposures[0]).all()  # rows that came before the new hold had passed
    assert (actual_exposures(USUAL, frames) == np.array(exposures)[:, None]).all()


def test_a_frame_that_holds_its_exposure_lasts_10_ms_and_a_longer_one_what_it_takes() -> None:
    assert USUAL.frame / USUAL.clock.hz == pytest.approx(0.01)
    assert USUAL.period(20 << 13) == USUAL.frame
    assert USUAL.period(20 << 14) == (20 << 14) + USUAL.turn
    assert frames_of(USUAL, [20 << 13])[0].hold == USUAL.frame - (20 << 13)


def test_no_reset_meets_a_sampling_phase() -> None:
    """For every step of the automatic at the printed settings; `disturbed` is what a count over
    all rows gives."""
    for a in range(25):
        for b in range(25):
            assert disturbed(USUAL, frames_of(USUAL, [20 << a, 20 << b])) == 0
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(300):
        frames = frames_of(SMALL, [int(e) for e in rng.integers(1, 200, 2)])
        count = 0
        for frame in frames:
            for row in range(SMALL.rows):
                for other in range(SMALL.rows):
                    if frame is frames[-1] and row == other:
                        continue
                    gap = frame.sample(other) - frames[-1].reset(row)
                    count += abs(gap) < SMALL.work
        assert disturbed(SMALL, frames) == count
        found += count > 0
    assert found > 10


def test_codes_close_on_themselves_with_one_bit() -> None:
    for states in (2, 6, 10, 20, 256, 480, 1000):
        codes = [ring(n, states) for n in range(states + 1)]
        assert len(set(codes)) == states and codes[-1] == codes[0]
        assert max(codes) < 1 << gray_bits(states)
        assert {(a ^ b).bit_count() for a, b in pairwise(codes)} == {1}
        ones = [johnson(n, states) for n in range(states + 1)]
        assert len(set(ones)) == states
        assert {(a ^ b).bit_count() for a, b in pairwise(ones)} == {1}
    assert [gray(n) for n in range(4)] == [0, 1, 3, 2]
    for bad in (0, 1, 7):
        with pytest.raises(ValueError, match="even"):
            ring(0, bad)
        with pytest.raises(ValueError, match="even"):
            johnson(0, bad)


def test_timings_that_cannot_be_are_refused() -> None:
    for changed in (
        {"rows": 7}, {"columns": 5}, {"cycle": 5}, {"line": 10}, {"line": 24}, {"frame": 168},
        {"turn": 6},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must"):
            Timing(**({"rows": 6, "columns": 6, "line": 28, "frame": 176, "cycle": 4, "turn": 8}
                      | changed))  # fmt: skip
    with pytest.raises(ValueError, match="frame_rate"):
        Timing.of(1024, 1280, 500)
    wide = Timing.of(1024, 1280)
    assert wide.lanes > 1 and wide.frame == 200_000
