"""How late a stream is processed: against its own clock, from its first plane on.

Plane n of a stream has the time t0 + edge(n) of its clock, where t0 is the instant at which the
first plane was there. A plane is *late* if its processing begins after its own time plus a bound.
So a chain that is slower than the camera is seen, and so is a camera that is slower than its clock;
how far the delay had grown tells by how much.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim import Clock
from cosim.stage import State

_NS: Final = 1000
"""Picoseconds in a nanosecond."""


class Lateness:
    """Counts the late planes of a stream.

    Args:
        clock: clock of the planes.
        bound: delay up to which a plane is in time, ps.

    Attributes:
        late: number of late planes so far.
        worst: largest delay of a plane so far, ps; negative if all were early. None before the
            first plane.
    """

    def __init__(self, clock: Clock, bound: int) -> None:
        self._clock, self._bound = clock, bound
        self._begin: tuple[int, int] | None = None
        self.late = 0
        self.worst: int | None = None

    def came(self, plane: int, at_ns: int) -> None:
        """Sets the clock by the first plane of this process, which was there at `at_ns`. Later
        calls change nothing."""
        if self._begin is None:
            self._begin = plane, at_ns

    def begun(self, start: int, stop: int, at_ns: int) -> None:
        """Counts planes `start` to `stop` (excluded), whose processing began at `at_ns`."""
        assert self._begin is not None
        first, begin = self._begin
        elapsed = (at_ns - begin) * _NS
        delay = elapsed - self._clock.edge(start - first)
        self.worst = delay if self.worst is None else max(self.worst, delay)
        # Plane n is late if edge(n - first) < elapsed - bound.
        before = first + self._clock.cycle_at(elapsed - self._bound - 1) + 1
        self.late += min(max(before - start, 0), stop - start)

    def state(self) -> State:
        """What a run that goes on needs; its clock begins with its own first plane."""
        worst = [] if self.worst is None else [self.worst]
        return {"late": np.array([self.late]), "worst": np.array(worst, np.int64)}

    def restore(self, state: State) -> None:
        self.late = int(state["late"][0])
        self.worst = int(state["worst"][0]) if state["worst"].size else None
