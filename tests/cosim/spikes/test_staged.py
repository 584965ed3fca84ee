"""A stream that a stage makes is the one that the stage makes block by block."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock, Events
from cosim.spikes.clocked import ClockedEvents, HeldPlanes, Reported
from cosim.spikes.staged import StagedStream
from cosim.spikes.viform import unpack_planes


def test_words_are_those_of_the_events():
    rng = np.random.default_rng(4)
    time = np.sort(rng.integers(0, 70, 200)).astype(np.int64)
    row, column = rng.integers(0, 5, 200), rng.integers(0, 7, 200)
    clock = Clock(1000)
    events = Events(
        row.astype(np.uint16), column.astype(np.uint16), time, np.ones(200, np.int64), (5, 7), 70,
        clock,
    )  # fmt: skip
    planes = np.zeros((70, 5, 7), bool)
    planes[time, row, column] = True
    stage = ClockedEvents(events, clock, 70)
    stream = StagedStream(stage, (5, 7), 70, clock)
    words = np.concatenate([stream.read_words(0, 1), stream.read_words(1, 3)])
    assert (unpack_planes(words, 0, 70) == planes).all()
    assert stage.spikes == planes.sum() and stage.lost == 200 - planes.sum()
    assert stream.read_words(3, 4).shape == (0, 5, 7)
    with pytest.raises(ValueError, match="from cycle 70 on, not 32"):
        stream.read_words(1, 2)


def test_skipped_cycles_are_made_nevertheless():
    """A held value fires in every third cycle, whichever words are read."""
    clock = Clock(1000)

    def planes(first):
        held = Reported(np.zeros(1, np.int64), np.zeros(1, np.int64), np.ones(1, np.int64))
        stream = StagedStream(HeldPlanes(held, (1, 1), clock, 3), (1, 1), 200, clock)
        return np.concatenate([stream.read_words(n, n + 1) for n in range(first, 7)])

    assert (planes(4) == planes(0)[4:]).all()
    assert planes(0).any()
