"""Planes of a clock from events and from held values, against closed forms."""

import numpy as np
import pytest

from cosim import Block, Clock, Events
from cosim.spikes.clocked import (
    Change,
    ClockedEvents,
    HeldPlanes,
    Reported,
    latching_cycles,
    tick_ends,
)

CLOCK = Clock(40_000)


class Given:
    """A list of changes."""

    def __init__(self, *changes):
        self.changes = changes

    def between(self, start, stop):
        return [change for change in self.changes if start <= change.cycle < stop]


def planes_of(stage, cycles, size=64):
    parts = [
        stage.step(None, Block(first, min(size, cycles - first))).planes()
        for first in range(0, cycles, size)
    ]
    return np.concatenate(parts)


@pytest.mark.parametrize("clock", [CLOCK, Clock(30_000), Clock(1_000_003, 7)])
def test_a_cycle_latches_what_happens_after_its_first_edge_up_to_its_last(clock):
    edges = [clock.edge(k) for k in range(5)]
    at = np.array([edges[1], edges[1] + 1, edges[2] - 1, edges[2], edges[4], edges[4] + 1, 0])
    assert latching_cycles(at, clock, 4).tolist() == [0, 1, 1, 1, 3, 4, 0]


@pytest.mark.parametrize("clock", [Clock(10**9), CLOCK, Clock(60), Clock(30_000, 1001)])
def test_ticks_end_at_the_next_edge(clock):
    time = np.array([0, 1, 7, 7, 100_001])
    assert tick_ends(time, clock).tolist() == [clock.edge(int(t) + 1) for t in time]


def events(row, column, time, ticks=10**6):
    n = len(time)
    return Events(
        np.array(row, np.uint16), np.array(column, np.uint16), np.array(time, np.int64),
        np.ones(n, np.int64), (2, 3), ticks, Clock(10**9),
    )  # fmt: skip


def test_events_become_spikes_and_what_a_cycle_cannot_hold_is_counted():
    """Ticks of 1 ns, cycles of 25 us; tick 24 999 ends at the edge and belongs to cycle 0."""
    stage = ClockedEvents(
        events([0, 1, 1, 1, 0, 0], [0, 2, 2, 2, 1, 1],
               [24_999, 25_000, 26_000, 49_999, 2_475_000, 2_500_000], 3 * 10**6), CLOCK, 100,
    )  # fmt: skip
    planes = planes_of(stage, 100, 32)
    assert sorted(zip(*np.nonzero(planes), strict=True)) == [(0, 0, 0), (1, 1, 2), (99, 0, 1)]
    assert (stage.spikes, stage.lost, stage.late) == (3, 2, 1)


@pytest.mark.parametrize("white", [1, 2, 255, 1000, 65_535, 2**30])
def test_the_number_of_spikes_is_the_closed_form_after_every_cycle(white):
    rng = np.random.default_rng(white)
    shape, cycles = (5, 7), 300
    changes = [
        Change(cycle, None, rng.integers(0, white + 1, 35)) for cycle in (0, 3, 64, 70, 129, 255)
    ]
    stage = HeldPlanes(Given(*changes), shape, CLOCK, white)
    start = stage.phase.astype(object)
    assert (start >= 0).all() and (start < white).all()
    fired = planes_of(stage, cycles).reshape(cycles, -1).astype(np.int64).cumsum(axis=0)
    total = np.zeros(35, object)
    at = {change.cycle: change.value for change in changes}
    value = np.zeros(35, np.int64)
    for cycle in range(cycles):
        value = at.get(cycle, value)
        total = total + value
        assert (fired[cycle] == (start + total) // white).all()
        assert (abs(fired[cycle] - total / white) <= 1).all()


def test_blocks_do_not_change_the_planes():
    rng = np.random.default_rng(4)
    cycle = np.sort(rng.integers(0, 200, 80))
    changes = Reported(cycle, rng.integers(0, 12, 80), rng.integers(0, 100, 80))
    one = planes_of(HeldPlanes(changes, (3, 4), CLOCK, 90), 200, 200)
    two = planes_of(HeldPlanes(changes, (3, 4), CLOCK, 90), 200, 32)
    np.testing.assert_array_equal(one, two)


def test_the_newest_report_of_a_cycle_holds_and_clipping_is_counted():
    changes = Reported(np.array([2, 2, 2]), np.array([1, 0, 1]), np.array([5, 3, 200]))
    (change,) = changes.between(0, 64)
    assert change.cycle == 2
    assert dict(zip(change.pixel.tolist(), change.value.tolist(), strict=True)) == {0: 3, 1: 200}
    stage = HeldPlanes(changes, (1, 2), CLOCK, 100)
    planes = planes_of(stage, 10)[:, 0]
    assert planes[:, 1].tolist() == [0, 0] + 8 * [1]
    assert (stage.given, stage.clipped) == (2, 1)


def test_equal_pixels_do_not_fire_in_step():
    """Of 400 pixels at a tenth of white, 40 fire in a cycle; in step, it would be all or none."""
    stage = HeldPlanes(Given(Change(0, None, np.full(400, 100))), (20, 20), CLOCK, 1000)
    counts = planes_of(stage, 100).sum(axis=(1, 2))
    assert counts.min() >= 30 and counts.max() <= 50


@pytest.mark.parametrize("white", [0, 2**30 + 1])
def test_a_white_that_does_not_fit_is_refused(white):
    with pytest.raises(ValueError, match=f"white must be 1 to {2**30}, not {white}"):
        HeldPlanes(Given(), (1, 1), CLOCK, white)


def test_a_span_without_reports_has_no_changes():
    reported = Reported(np.array([0, 90]), np.array([0, 1]), np.array([5, 6]))
    assert [change.cycle for change in reported.between(0, 64)] == [0]
    assert list(reported.between(64, 80)) == []
    assert [change.cycle for change in reported.between(80, 128)] == [90]
