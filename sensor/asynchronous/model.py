"""The rules of an asynchronous pixel, and the events that it sends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.spikes.events import time_order

_COLUMNS: Final = ("pixel", "instant", "width", "exact", "level")


def least_electrons(level: int, threshold: int, levels: int) -> int:
    """The least electrons that read as `level` of `levels`: floor(levels n / threshold) = level."""
    return -(-level * threshold // levels)


@dataclass(frozen=True)
class EventModel:
    """The rules of one interval, Huang 2022 sections 4.3 to 4.5 and 5.2. Times are in picoseconds.

    The period under steady light is max(Q/light + delay, shortest) + reset.

    Attributes:
        threshold: Q, whole electrons.
        seed: seed of the run, below 2^32.
        clock: measures times and widths; its period is a whole number of picoseconds.
        shortest: least width that the circuit can read out, at least a period. A pixel that is full
            sooner stays full, loses what arrives, and fires at the end of this time.
        longest: time after which the charge is read without a spike and the pixel is reset; 0 for
            never.
        levels: N of that reading, floor(N charge / Q).
        delay: delay of the comparator; it is part of the width.
        reset: dead time after each spike or reading, in which light is lost.
        change: a spike is sent only if its width differs from the last one sent by more than
            `change` times the relative standard deviation of that width, 1/sqrt(Q); a reading, if
            its level differs by more than `change` times the Poisson deviation of the last one
            sent, or if the last was a spike. 0 sends everything. The pixel compares widths before
            the clock measures them.
        shot: whether there is shot noise; without it every threshold is Q.
    """

    threshold: int
    seed: int
    clock: Clock
    shortest: int
    longest: int = 0
    levels: int = 1
    delay: int = 0
    reset: int = 0
    change: float = 0.0
    shot: bool = True

    def __post_init__(self) -> None:
        if not 1 <= self.threshold < 2**21:
            raise ValueError(f"threshold must be 1 to {2**21 - 1} e, not {self.threshold} e")
        if PS * self.clock.den % self.clock.num:
            raise ValueError(f"a period must be whole picoseconds, not that of {self.clock}")
        if self.shortest < self.tick:
            raise ValueError(f"the shortest width must be {self.tick} ps or more")
        if self.longest and self.longest < self.shortest:
            raise ValueError("the longest width must not be below the shortest")
        if not 1 <= self.levels < 2**16 or (self.levels > 1 and not self.longest):
            raise ValueError("levels must be 1 to 65535, and 1 without a longest width")
        if min(self.delay, self.reset) < 0 or not 0 <= self.change < np.inf:
            raise ValueError("delay, reset and change must be 0 or more")

    @property
    def tick(self) -> int:
        """Period of the clock in picoseconds."""
        return PS * self.clock.den // self.clock.num

    def electrons(self, level: int) -> tuple[int, int]:
        """The least and the most electrons that read as `level`."""
        q, n = self.threshold, self.levels
        return least_electrons(level, q, n), min(least_electrons(level + 1, q, n), q) - 1


@dataclass(frozen=True, eq=False)
class Firings:
    """What pixels send, in order of time; those of one picosecond in the order of their numbers.

    Attributes:
        pixel: number in the array, (n,) uint32.
        instant: instant in picoseconds, rounded up, (n,) int64.
        width: width in ticks, from the one in which the interval began to the one in which it
            ended, (n,) int64.
        exact: width in picoseconds before the clock measured it, (n,) float64.
        level: level, of `EventModel.levels`, which itself is a full spike, (n,) uint16.
        work: turns of the inner loop.
    """

    pixel: npt.NDArray[np.uint32]
    instant: npt.NDArray[np.int64]
    width: npt.NDArray[np.int64]
    exact: npt.NDArray[np.float64]
    level: npt.NDArray[np.uint16]
    work: int = 0

    def __len__(self) -> int:
        return len(self.instant)

    def take(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> Firings:
        """The firings that a mask or indices select."""
        return Firings(
            self.pixel[chosen], self.instant[chosen], self.width[chosen], self.exact[chosen],
            self.level[chosen], self.work,
        )  # fmt: skip

    def ordered(self) -> Firings:
        """The same firings in the order of the class, from any order."""
        return self.take(time_order(self.instant, self.pixel))

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The columns, for a checkpoint."""
        columns = {name: getattr(self, name) for name in _COLUMNS}
        return columns | {"work": np.array(self.work)}

    @staticmethod
    def of_state(state: Mapping[str, npt.NDArray[Any]]) -> Firings:
        """The firings of the arrays that `state` returned."""
        pixel, instant, width, exact, level = (state[name] for name in _COLUMNS)
        return Firings(pixel, instant, width, exact, level, int(state["work"]))

    @staticmethod
    def join(parts: list[Firings]) -> Firings:
        """Several one after another, as they are. The list is emptied and its arrays let go column
        by column, so that they and the whole do not lie in memory together."""
        if not parts:
            empty = np.zeros(0, np.int64)
            return Firings(
                empty.astype(np.uint32), empty, empty, empty.astype(np.float64),
                empty.astype(np.uint16),
            )  # fmt: skip
        if len(parts) == 1:
            return parts.pop()
        work = sum(p.work for p in parts)
        columns: list[list[Any]] = [
            [p.pixel for p in parts], [p.instant for p in parts], [p.width for p in parts],
            [p.exact for p in parts], [p.level for p in parts],
        ]  # fmt: skip
        parts.clear()
        joined: list[Any] = []
        while columns:
            joined.append(np.concatenate(columns.pop(0)))
        pixel, instant, width, exact, level = joined
        return Firings(pixel, instant, width, exact, level, work)


def latched(instant: npt.NDArray[np.int64], tick: int) -> npt.NDArray[np.int64]:
    """The tick that latches an instant (ps): tick k lasts from after k to (k + 1) periods, as a
    synchronous chip latches at the end of a cycle what fired in it."""
    return -(-instant // tick) - 1
