"""Symbols around ticks that a recording lacks: learning without them, and their soft values.

The ticks were put in without spikes, which would tell of light that was off. So the symbols are
detected twice, as if no pixel had fired in these ticks, and as if all had: the mean of the soft
values is small where the missing ticks decide, and other ticks keep what they tell. Leaving out the
missing ticks alone is not enough, since the laws of the next ticks depend on whether a pixel fired.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from link.detect.counting import CONTEXT
from link.detect.detector import Bits, Detector, Soft
from link.layout import TRAINING
from link.receiving.recording import Gap, Recording
from link.timing import Timing

if TYPE_CHECKING:
    from link.coding import BlockReader


def learn_known(
    detector: Detector, recording: Recording, timing: Timing, known: Bits, first: int, *late: float
) -> None:
    """Has a detector learn from known symbols, those at gaps excepted. late: of `Joint.learn`."""
    given: Any = detector
    for begin, end in whole_parts(recording, timing, first, len(known)):
        part = known[begin - first : end - first]
        given.learn(recording.words, recording.first, part, begin, *late)


def whole_parts(
    recording: Recording, timing: Timing, first: int, count: int
) -> list[tuple[int, int]]:
    """Stretches of `count` symbols from `first` on that touch no gap, end excluded."""
    whole = np.ones(count, np.bool_)
    for gap in recording.gaps:
        for n in range(count):
            begin, end = _ticks_of(timing, first + n, 1)
            whole[n] &= gap.tick >= end or gap.last + gap.count <= begin
    edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(np.int8)))
    return [(first + a, first + b) for a, b in edges.reshape(-1, 2).tolist()]


def mended(
    soft: Soft, detector: Detector, recording: Recording, timing: Timing, first: int,
    inbox: BlockReader,
) -> Soft:  # fmt: skip
    """Soft values of whole groups from symbol `first` on, those around a gap detected again: with
    it at the place, of those that may be, at which most words can be read. No thread may use the
    detector meanwhile."""
    count, size = len(soft), inbox.layout.group
    gap = _gap_within(recording, timing, first, count)
    if gap is None:
        return soft
    group, most = (first - TRAINING) // size, -1
    for place in range(gap.tick, gap.last + 1):
        tried = _soft_around(detector, recording, timing, gap, place, first, count)
        parts = enumerate(np.split(tried, count // size))
        read = sum(inbox.readable(group + n, part) for n, part in parts)
        if read > most:
            soft, most = tried, read
    return soft


def _soft_around(
    detector: Detector, recording: Recording, timing: Timing, gap: Gap, place: int, first: int,
    count: int,
) -> Soft:  # fmt: skip
    """Soft values of `count` symbols from `first` on, (count, cells), around a gap.

    Args:
        detector: detector that has learned.
        recording: recording with the missing ticks put in.
        timing: timing of the symbols.
        gap: the gap.
        place: first tick that is missing, of those that may be.
        first, count: the symbols.
    """
    words = recording.words.copy()
    at = gap.tick - recording.first
    bits = [(n >> 5, np.uint32(n & 31)) for n in range(at, place - recording.first + gap.count)]
    for (w, bit), (later, other) in zip(bits, bits[gap.count :], strict=False):
        _put(words[w], bit, words[later] >> other)
    soft = []
    for spike in (0, 1):
        for w, bit in bits[-gap.count :]:
            _put(words[w], bit, np.uint32(spike))
        soft.append(detector.soft(words, recording.first, first, count, recording.stop))
    held = 1 - _missing_share(timing, place, gap.count, first, count)
    return np.asarray(held[:, None] * (soft[0] + soft[1]) / 2, np.float32)


def _missing_share(
    timing: Timing, tick: int, missing: int, first: int, count: int
) -> npt.NDArray[np.float64]:
    """Share of each symbol in the missing ticks, (count,), in the row with most."""
    begin = timing.start(
        first + np.arange(count)[:, None], np.array([0, timing.rows / 2, timing.rows])
    )
    inside = np.minimum(begin + timing.period, tick + missing) - np.maximum(begin, tick)
    return np.asarray(np.clip(inside / timing.period, 0, 1).max(axis=1))


def _ticks_of(timing: Timing, first: int, count: int) -> tuple[int, int]:
    """Ticks of symbols, those before included whose charge they may hold."""
    rows = np.array([0, timing.rows])
    begin, end = timing.start(first, rows), timing.start(first + count, rows)
    return int(np.floor(begin.min())) - CONTEXT, int(np.ceil(end.max()))


def _gap_within(recording: Recording, timing: Timing, first: int, count: int) -> Gap | None:
    """First gap that may touch `count` symbols from `first` on."""
    begin, end = _ticks_of(timing, first, count)
    touching = (g for g in recording.gaps if g.tick < end and g.last + g.count > begin)
    return min(touching, key=lambda gap: gap.tick, default=None)


def _put(word: npt.NDArray[np.uint32], bit: np.uint32, value: Any) -> None:
    """Sets a bit of (H, W) words to the lowest one of a value."""
    word &= ~(np.uint32(1) << bit)
    word |= (value & np.uint32(1)) << bit
