"""Event form: checks of its content, and conversion to planes and back."""

import numpy as np
import pytest

from cosim import Clock, Events, Viform
from cosim.spikes.events import time_order
from tests.cosim.spikes.whole_streams import events_of, viform_of

CLOCK = Clock(40_000)


def made(**changed: object) -> Events:
    values = {
        "row": np.array([0, 1, 0], np.uint16),
        "column": np.array([1, 2, 1], np.uint16),
        "time": np.array([3, 3, 40], np.int64),
        "width": np.array([4, 4, 37], np.int64),
        "shape": (2, 3),
        "ticks": 50,
        "clock": CLOCK,
    }
    return Events(**{**values, **changed})


def test_there_and_back():
    planes = np.random.default_rng(1).random((77, 5, 9)) < 0.2
    stream = Viform(Viform.from_planes(planes, CLOCK).words, 77, CLOCK, start=1000)
    events = events_of(stream)
    assert len(events) == planes.sum()
    assert viform_of(events) == stream


def test_widths_add_up_to_the_time_of_the_last_spike():
    planes = np.random.default_rng(2).random((100, 4, 4)) < 0.3
    events = events_of(Viform.from_planes(planes, CLOCK))
    for row in range(4):
        for column in range(4):
            own = (events.row == row) & (events.column == column)
            assert events.width[own].sum() == events.time[own][-1] + 1


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"row": np.array([0, 2, 0], np.uint16)}, "2 rows"),
        ({"column": np.array([0, 3, 0], np.uint16)}, "3 columns"),
        ({"time": np.array([3, 2, 40], np.int64)}, "rise"),
        ({"time": np.array([3, 4, 50], np.int64)}, "49"),
        ({"width": np.array([4, 0, 1], np.int64)}, "1 tick"),
        ({"width": np.array([4, 1], np.int64)}, r"\(3,\) int64"),
        ({"level": np.array([1, 2, 3], np.uint16), "levels": 2}, "2 or less"),
        ({"ticks": 0}, "1 or more"),
    ],
)
def test_refuses(changed: dict[str, object], says: str):
    with pytest.raises(ValueError, match=says):
        made(**changed)


def test_planes_hold_one_full_spike_a_pixel_and_tick():
    twice = made(time=np.array([3, 3, 3], np.int64))
    with pytest.raises(ValueError, match="full spikes"):
        viform_of(twice)
    partial = made(level=np.array([2, 1, 2], np.uint16), levels=2)
    with pytest.raises(ValueError, match="full spikes"):
        viform_of(partial)
    assert viform_of(made(level=np.array([2, 2, 2], np.uint16), levels=2)) == viform_of(made())


def test_equal_by_content():
    assert made() == made()
    assert made() != made(start=-1)
    assert made() != made(level=np.array([1, 1, 1], np.uint16))
    assert made() != "events"


@pytest.mark.parametrize("latest", [9, 2**30, 2**62])
def test_events_are_ordered_by_time_and_pixel(latest: int) -> None:
    """Also where time and pixel do not fit into one key."""
    rng = np.random.default_rng(2)
    time, pixel = rng.integers(latest // 3, latest, 5000), rng.permutation(2**20)[:5000]
    time[0] = latest
    order = np.lexsort((pixel, time))
    assert np.array_equal(time_order(time, pixel.astype(np.uint32)), order)
    assert np.array_equal(time_order(time[order], pixel[order]), np.arange(5000))
    for few in (0, 1):
        assert np.array_equal(time_order(time[:few], pixel[:few]), np.arange(few))
