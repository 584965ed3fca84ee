"""Writes to the registers of a running chip: the threshold level and the rows that are read out.

A write at cycle c holds from cycle c on; the bits of cycles before c do not know of it.

Threshold: the comparator's level. It applies to the running interval at once. The stored charge is
kept, and the interval needs the quantile of its own random word at the new level, so all tiers know
it. A pixel that stores as much or more fires in cycle c. With shot noise the threshold of the one
interval that runs across a write is not the law of a counter of photons given its history, but the
quantile of the same rank; its mean is off by at most about |sqrt(Q1) - sqrt(Q2)| electrons, and all
later intervals have the law of the new level.

Window: rows [first, stop). Rows outside are held in reset: no spikes, and no charge. A row that
comes back starts cycle c without charge, as on the board (`sensor_rows`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Write:
    """One write.

    Attributes:
        cycle: first cycle for which it holds.
        threshold: electrons, None to keep it.
        window: (first, stop) rows that are read from then on, None to keep them.
    """

    cycle: int
    threshold: float | None = None
    window: tuple[int, int] | None = None


@dataclass(frozen=True)
class Phase:
    """The registers between two writes.

    Attributes:
        start: first cycle.
        threshold: electrons.
        window: (first, stop) rows that are read.
    """

    start: int
    threshold: float
    window: tuple[int, int]


def phases_of(writes: Sequence[Write], threshold: float, height: int) -> tuple[Phase, ...]:
    """The phases of a run, the first of which starts at cycle 0.

    Args:
        writes: writes in the order of their cycles, which differ.
        threshold: threshold before the first write, electrons.
        height: rows of the chip, which are all read before the first write.

    Raises:
        ValueError: the cycles do not ascend, or a window is empty or exceeds the chip.
    """
    if any(a.cycle >= b.cycle for a, b in pairwise(writes)) or any(w.cycle < 0 for w in writes):
        raise ValueError(f"writes must ascend from cycle 0, not {[w.cycle for w in writes]}")
    phases = [Phase(0, threshold, (0, height))]
    for write in writes:
        before = phases[-1]
        window = before.window if write.window is None else write.window
        if not 0 <= window[0] < window[1] <= height:
            raise ValueError(f"window must be rows within 0 to {height}, not {window}")
        level = before.threshold if write.threshold is None else write.threshold
        phases.append(Phase(write.cycle, level, window))
    return tuple(phases[1:] if phases[1:] and phases[1].start == 0 else phases)


def _overlaps(phases: Sequence[Phase], first: int, stop: int) -> list[tuple[Phase, int]]:
    """Phases that a span of cycles meets, with the number of cycles in each."""
    ends = [phase.start for phase in phases[1:]] + [stop]
    spans = [
        (phase, min(end, stop) - max(phase.start, first))
        for phase, end in zip(phases, ends, strict=True)
    ]
    return [(phase, cycles) for phase, cycles in spans if cycles > 0]


def threshold_shares(
    phases: Sequence[Phase], threshold: float, height: int, first: int, stop: int
) -> npt.NDArray[np.float64]:
    """Spikes of each row in cycles `first` to `stop`, over those with this threshold and all rows
    read, (height,): the mean of threshold / Q over the cycles, 0 where a row is not read. Charge
    that is kept across a write is less than a spike and is neglected."""
    shares = np.zeros(height)
    for phase, cycles in _overlaps(phases, first, stop):
        ratio = threshold / phase.threshold
        shares[slice(*phase.window)] += ratio * cycles / (stop - first)
    return shares


def rows_read(phases: Sequence[Phase], first: int, stop: int) -> tuple[int, int]:
    """(first, stop) rows that are read in all cycles from `first` to `stop`; an empty range if
    there is none."""
    windows = [phase.window for phase, _ in _overlaps(phases, first, stop)]
    top, low = max(window[0] for window in windows), min(window[1] for window in windows)
    return top, max(top, low)


@dataclass(frozen=True)
class Registers:
    """Thresholds and windows of a run, for the scale of its images.

    Attributes:
        phases: the registers between the writes.
        threshold: threshold to which rates are relative, electrons.
        height: rows of the chip.
    """

    phases: tuple[Phase, ...]
    threshold: float
    height: int

    def shares(self, first: int, stop: int) -> npt.NDArray[np.float64]:
        """`threshold_shares` in cycles `first` to `stop`, as a column, (height, 1)."""
        return threshold_shares(self.phases, self.threshold, self.height, first, stop)[:, None]

    def rows(self, first: int, stop: int) -> tuple[int, int]:
        """`rows_read` in cycles `first` to `stop`."""
        return rows_read(self.phases, first, stop)

    def untouched(self, cycle: int) -> tuple[int, int]:
        """(first, stop) cycles around `cycle` whose intervals no write has changed: those of its
        phase, without the first one after a write. A pixel whose charge is above a lowered level
        fires in that one, and keeps the rest."""
        last = max(n for n, phase in enumerate(self.phases) if phase.start <= max(cycle, 0))
        first = self.phases[last].start + (last > 0)
        stop = self.phases[last + 1].start if last + 1 < len(self.phases) else sys.maxsize
        return first, stop
