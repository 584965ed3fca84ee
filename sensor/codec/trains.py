"""The first-spike code in its plain form: every event of a viform to first spikes and back.

Huang 2022, section 5.2 and figure 1(d): a spike whose width differs from the current one is sent as
(i, j, t, tau) and its width becomes the current one; silence means repetition. So after a first
spike at t the pixel fires at t + tau, t + 2 tau, ... The next first spike (t', tau') says where
that ends: its own interval began at t' - tau', which is the last repetition. The paper does not say
what the stream's end means. Here repetition goes on up to the last tick; a pixel that would have
fired once more by then but did not gets a closing one at t = start + ticks, one tick past the end,
which is no spike and whose width is the interval that was running.

A decoder cannot know before the next first spike whether a silent pixel repeats or has gone dark:
the code is lossless, but what it says of a tick is settled only later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim import Clock, Events

Ticks = npt.NDArray[np.int64]
Places = npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class FirstSpikes:
    """First spikes in the order of time.

    Attributes:
        row, column: (n,) uint16.
        time: (n,) int64 ticks; start + ticks for a closing one.
        width: (n,) int64 ticks.
        shape: (H, W). The stream covers start .. start + ticks - 1.
    """

    row: Places
    column: Places
    time: Ticks
    width: Ticks
    shape: tuple[int, int]
    ticks: int
    clock: Clock
    start: int = 0

    def __len__(self) -> int:
        return len(self.time)

    def take(self, which: npt.NDArray[np.bool_]) -> FirstSpikes:
        """The first spikes where the mask `which`, (n,) bool, is true."""
        return replace(
            self,
            row=self.row[which],
            column=self.column[which],
            time=self.time[which],
            width=self.width[which],
        )


def _pixel(row: Places, column: Places, shape: tuple[int, int]) -> Ticks:
    return row.astype(np.int64) * shape[1] + column


def first_spikes(events: Events) -> FirstSpikes:
    """The first spikes of a viform. Raises ValueError for what the code cannot hold: partial
    spikes, and intervals that do not follow one another (a pause after a spike)."""
    if events.level is not None and not bool((events.level == events.levels).all()):
        raise ValueError("the first-spike code holds full spikes alone")
    pixel = _pixel(events.row, events.column, events.shape)
    order = np.lexsort((events.time, pixel))
    pixel, time, width = pixel[order], events.time[order], events.width[order]
    same = np.append(np.zeros(min(len(pixel), 1), bool), pixel[1:] == pixel[:-1])
    if not (time - np.where(same, np.roll(time, 1), events.start - 1) == width).all():
        raise ValueError("intervals must follow one another")
    sent = ~(same & (width == np.roll(width, 1)))
    # A spike repeats its predecessor's width, so the current width is always the last spike's.
    end = events.start + events.ticks
    closing = np.append(~same[1:], np.ones(min(len(same), 1), bool)) & (time + width < end)
    rows, columns = events.row[order], events.column[order]
    joined = (
        np.concatenate([array[sent], more[closing]])
        for array, more in (
            (rows, rows),
            (columns, columns),
            (time, np.full(len(time), end)),
            (width, end - time),
        )
    )
    row, column, when, wide = joined
    back = np.lexsort((column, row, when))
    return FirstSpikes(
        row[back], column[back], when[back], wide[back],
        events.shape, events.ticks, events.clock, events.start,
    )  # fmt: skip


def _in_force(first: FirstSpikes) -> tuple[npt.NDArray[np.intp], Ticks, npt.NDArray[np.bool_]]:
    """Order by pixel and time; spikes each stands for (0: a closing one) and whether the next one
    is the same pixel's, both in that order."""
    pixel = _pixel(first.row, first.column, first.shape)
    order = np.lexsort((first.time, pixel))
    pixel, time, width = pixel[order], first.time[order], first.width[order]
    follows = np.append(pixel[1:] == pixel[:-1], np.zeros(min(len(pixel), 1), bool))
    end = first.start + first.ticks
    limit = np.where(follows, np.roll(time - width, -1), end - 1)
    spikes = np.maximum((limit - time) // np.maximum(width, 1), 0) + 1
    return order, np.where(time < end, spikes, 0), follows


def repeated(first: FirstSpikes) -> Events:
    """All spikes that first spikes represent: the inverse of `first_spikes`."""
    order, spikes, _ = _in_force(first)
    which = np.repeat(order, spikes)
    n = np.arange(len(which)) - np.repeat(np.cumsum(spikes) - spikes, spikes)
    time = first.time[which] + n * first.width[which]
    back = np.lexsort((first.column[which], first.row[which], time))
    which, time = which[back], time[back]
    return Events(
        first.row[which], first.column[which], time, first.width[which],
        first.shape, first.ticks, first.clock, first.start,
    )  # fmt: skip


def without_transitions(first: FirstSpikes) -> FirstSpikes:
    """Intensity alone: of the first spikes between two steady stretches (in force for two intervals
    or more) those in force for one interval only are dropped, as 5 and 12 of figure 1 are. Those
    before a pixel's first steady stretch and after its last one stay."""
    order, spikes, follows = _in_force(first)
    n = len(order)
    index = np.arange(n)
    head = np.append(True, ~follows[:-1]) if n else follows
    tail = ~follows
    group = np.cumsum(head)
    steady = spikes >= 2
    # Nearest steady one at or before, and at or after, each; it counts in the same pixel alone.
    before = np.maximum.accumulate(np.where(steady | head, index, 0)) if n else index
    after = np.minimum.accumulate(np.where(steady | tail, index, n - 1)[::-1])[::-1] if n else index
    between = steady[before] & steady[after] & (group[before] == group[after])
    keep = np.empty(n, bool)
    keep[order] = ~(between & (spikes == 1))
    return first.take(keep)


def levels(first: FirstSpikes) -> tuple[Places, Places, Ticks, Ticks]:
    """What first spikes say of the light: row, column, the tick after which a width is in force
    (t - tau), and the width; by pixel, then time. Each holds until the pixel's next one; light is
    one threshold a width."""
    order, spikes, _ = _in_force(first)
    order = order[spikes > 0]
    begin = first.time[order] - first.width[order]
    return first.row[order], first.column[order], begin, first.width[order]
