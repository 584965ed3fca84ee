"""Events and held values as the spike planes of a clock.

A display with a clock shows the spikes of a cycle in one plane. Cycle k latches what happens after
edge k and up to edge k + 1, as a synchronous chip does. Two stages make such planes block by block:
`ClockedEvents` from spikes at any instant, and `HeldPlanes` from values that change at some cycles
and are held between.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.spikes.events import Events, mark_planes
from cosim.spikes.intensities import Intensities
from cosim.spikes.viform import WORD, Viform, Words, words_for
from cosim.stage import Block, State

Cycles = npt.NDArray[np.int64]
Values = npt.NDArray[np.int64]
_LARGEST: Final = 2**30
"""Upper limit of white, so that a phase and a value add up within 32 bits."""
_STEPS: Final = 3242174889, 2447445414
"""2^32 over the plastic number 1.3247 and over its square: multiples of the pair spread evenly over
the unit square (the R2 sequence, Roberts 2018)."""
FINE: Final = 2**30
"""Value of a spike in every cycle where values are no integers: they are rounded to 2^-30."""


def latching_cycles(instants: Cycles, clock: Clock, cycles: int) -> Cycles:
    """The cycle that latches each instant (ps), (n,) int64; `cycles` for those after the last one.
    An instant at edge 0 or before belongs to cycle 0."""
    edges = np.array([clock.edge(k) for k in range(cycles + 1)], np.int64)
    return np.maximum(np.searchsorted(edges, instants, side="left") - 1, 0)


def tick_ends(time: Cycles, clock: Clock) -> Cycles:
    """The instants at which ticks of a clock end, ps, (n,) int64."""
    tick, rest = divmod(PS * clock.den, clock.num)
    if not rest:
        return (time + 1) * tick
    known, place = np.unique(time, return_inverse=True)
    return np.array([clock.edge(int(t) + 1) for t in known], np.int64)[place]


class ClockedEvents:
    """A stage that latches events in the cycles of a clock.

    Args:
        events: full spikes, in the order of time.
        clock, cycles: clock and number of the planes, which begin at the instant 0.

    Attributes:
        spikes: spikes in the planes so far.
        lost: spikes so far of a pixel that has fired before in the same cycle.
        late: events after the last cycle.
    """

    def __init__(self, events: Events, clock: Clock, cycles: int) -> None:
        self._clock, self._events = clock, events
        self._cycle = latching_cycles(tick_ends(events.time, events.clock), clock, cycles)
        self.spikes = self.lost = 0
        self.late = int((self._cycle >= cycles).sum())

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block; `data` is not used."""
        first, stop = np.searchsorted(self._cycle, [block.start, block.stop])
        words: Words = np.zeros((words_for(block.cycles), *self._events.shape), np.uint32)
        inside = slice(first, stop)
        mark_planes(
            words, self._events.row[inside], self._events.column[inside],
            self._cycle[inside] - block.start,
        )  # fmt: skip
        latched = int(np.bitwise_count(words).sum(dtype=np.int64))
        self.spikes += latched
        self.lost += int(stop - first) - latched
        return Viform(words, block.cycles, self._clock, block.start)

    def state(self) -> State:
        """The counts: nothing else depends on earlier blocks."""
        return {"counts": np.array([self.spikes, self.lost], np.int64)}

    def restore(self, state: State) -> None:
        """Restores a `state`."""
        self.spikes, self.lost = (int(n) for n in state["counts"])


class Change(NamedTuple):
    """New values of some pixels.

    Attributes:
        cycle: cycle from which they hold.
        pixel: (n,) numbers of the pixels, row x width + column; all if None.
        value: (n,) int64 >= 0.
    """

    cycle: int
    pixel: npt.NDArray[np.int64] | None
    value: Values


class Changes(Protocol):
    """The changes of held values in the order of cycles."""

    def between(self, start: int, stop: int) -> Iterable[Change]:
        """The changes from cycle `start` to before `stop`; called for consecutive spans."""
        ...


class HeldPlanes:
    """A stage that turns held values into spikes: a digital integrate-and-fire of each pixel, which
    is a first-order sigma-delta modulator.

    In every cycle a pixel adds its value v to its phase; if the phase reaches `white`, the pixel
    fires and `white` is subtracted. All are integers, so after any number of cycles the pixel has
    fired exactly floor((p + sum of v) / white) times, with p its phase at the start: the rate is
    v / white, and the number of spikes is within one of the sum. The phases at the start differ
    from pixel to pixel (the R2 sequence), so that equal pixels do not fire in step. A value above
    `white` counts as `white`: a pixel fires once a cycle at most.

    Args:
        changes: the values; a pixel without one is dark.
        shape: (H, W).
        clock: clock of the planes.
        white: value that fires in every cycle, 1 to 2^30.

    Attributes:
        spikes: spikes so far.
        clipped: new values above white so far.
        given: new values so far.
    """

    def __init__(self, changes: Changes, shape: tuple[int, int], clock: Clock, white: int) -> None:
        if not 1 <= white <= _LARGEST:
            raise ValueError(f"white must be 1 to {_LARGEST}, not {white}")
        self._changes, self._shape, self._clock, self._white = changes, shape, clock, white
        row, column = np.indices(shape, np.uint64).reshape(2, -1)
        spread = (column * np.uint64(_STEPS[0]) + row * np.uint64(_STEPS[1])) % np.uint64(2**32)
        self.phase = (spread * np.uint64(white) >> np.uint64(32)).astype(np.int32)
        self._value = np.zeros(row.size, np.int32)
        self.spikes = self.clipped = self.given = 0

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block; blocks are consecutive. `data` is not used."""
        words: Words = np.zeros((words_for(block.cycles), self._value.size), np.uint32)
        at = block.start
        for change in self._changes.between(block.start, block.stop):
            self._fire(words, block.start, at, change.cycle)
            at = change.cycle
            self._put(change)
        self._fire(words, block.start, at, block.stop)
        self.spikes += int(np.bitwise_count(words).sum(dtype=np.int64))
        return Viform(words.reshape(-1, *self._shape), block.cycles, self._clock, block.start)

    def _put(self, change: Change) -> None:
        self.given += change.value.size
        self.clipped += int((change.value > self._white).sum())
        value = np.minimum(change.value, self._white).astype(np.int32)
        self._value[slice(None) if change.pixel is None else change.pixel] = value

    def _fire(self, words: Words, begin: int, start: int, stop: int) -> None:
        """Fills the bits of the cycles `start` to `stop`; `begin` is the cycle of the first bit."""
        phase, white = self.phase, np.int32(self._white)
        for n in range(start - begin, stop - begin):
            phase += self._value
            fired = phase >= white
            np.subtract(phase, white, out=phase, where=fired)
            words[n // WORD] |= fired.astype(np.uint32) << np.uint32(n % WORD)


class Reported:
    """Reports of single pixels as `Changes`.

    Args:
        cycle: (n,) int64, rising, cycle from which each report holds.
        pixel: (n,) int64; of two reports of a pixel in one cycle the later one holds.
        value: (n,) int64.
    """

    def __init__(self, cycle: Cycles, pixel: npt.NDArray[np.int64], value: Values) -> None:
        self._cycle, self._pixel, self._value = cycle, pixel, value

    def between(self, start: int, stop: int) -> Sequence[Change]:
        """See `Changes`."""
        first, last = np.searchsorted(self._cycle, [start, stop])
        if first == last:
            return []
        cycles = self._cycle[first:last]
        places = np.flatnonzero(np.diff(cycles, prepend=-1)) + first
        ends = [*places[1:].tolist(), last]
        return [self._newest(slice(a, b)) for a, b in zip(places.tolist(), ends, strict=True)]

    def _newest(self, span: slice) -> Change:
        pixel, value = self._pixel[span], self._value[span]
        chosen, place = np.unique(pixel[::-1], return_index=True)
        return Change(int(self._cycle[span.start]), chosen, value[::-1][place])


Rates = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]]
"""Spikes a cycle that a panel shows for those of a camera, (n,)."""


def held_events(
    events: Events, clock: Clock, cycles: int, shown: Rates | None = None
) -> HeldPlanes:  # fmt: skip
    """The planes of events that are sent only where a width has changed: until its next event a
    pixel fires at the rate of the last width, or of the last reading of its charge. shown: maps
    these rates to those of the planes; None for the same."""
    held = Reported(*held_values(events, clock, cycles, shown))
    return HeldPlanes(held, events.shape, clock, FINE)


def held_values(
    events: Events, clock: Clock, cycles: int, shown: Rates | None = None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Cycle, pixel and value of these events for `Reported`, of which FINE fires in every cycle."""
    share = np.ones(len(events)) if events.level is None else events.level / events.levels
    a_cycle = events.clock.hz / clock.hz  # ticks
    rate = share * a_cycle / events.width
    value = np.rint(np.minimum(FINE * (rate if shown is None else shown(rate)), 2.0 * FINE))
    cycle = latching_cycles(tick_ends(events.time, events.clock), clock, cycles)
    pixel = events.row.astype(np.int64) * events.shape[1] + events.column
    return cycle, pixel, value.astype(np.int64)


def held_reports(
    reports: Intensities, white: float, white_rate: float, shown: Rates | None = None
) -> HeldPlanes:  # fmt: skip
    """The planes of the reports of continuous pixels.

    Args:
        reports: electrons a second.
        white: value of white, electrons a second.
        white_rate: spikes a cycle of white.
        shown: maps these rates to those of the planes; None for the same.
    """
    rate = reports.value * (white_rate / white)
    value = np.rint(np.minimum(FINE * (rate if shown is None else shown(rate)), 2.0 * FINE))
    held = Reported(reports.time, reports.pixel, value.astype(np.int64))
    return HeldPlanes(held, reports.shape, reports.clock, FINE)
