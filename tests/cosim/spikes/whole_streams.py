"""Whole streams as events and back, in memory: the package itself converts them block by block."""

from __future__ import annotations

import numpy as np

from cosim import Events, SpikeStream, Viform
from cosim.spikes.events import event_blocks, mark_planes
from cosim.spikes.viform import Words, words_for


def events_of(stream: SpikeStream) -> Events:
    """All spikes of a synchronous stream, with the interval as width; those of one cycle are in
    row-major order."""
    row, column, time, width = (
        np.concatenate(parts) for parts in zip(*event_blocks(stream), strict=True)
    )
    start = int(getattr(stream, "start", 0))
    return Events(row, column, time, width, stream.shape, stream.cycles, stream.clock, start)


def viform_of(events: Events) -> Viform:
    """The spike planes of events. Raises ValueError for spikes that are not full, and for more than
    one spike a pixel and tick."""
    full = events.level is None or bool((events.level == events.levels).all())
    words: Words = np.zeros((words_for(events.ticks), *events.shape), np.uint32)
    mark_planes(words, events.row, events.column, events.time - events.start)
    if not full or int(np.bitwise_count(words).sum(dtype=np.int64)) != len(events):
        raise ValueError("planes hold full spikes alone, at most one a pixel and tick")
    return Viform(words, events.ticks, events.clock, events.start)
