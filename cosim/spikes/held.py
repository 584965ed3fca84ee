"""Events and reports that hold until the next one, as the spike planes of a clock."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.spikes.clocked import HeldPlanes, Reported, latching_cycles, tick_ends
from cosim.spikes.events import Events
from cosim.spikes.intensities import Intensities

FINE: Final = 2**30
"""Value of a spike in every cycle where values are no integers: they are rounded to 2^-30."""


def held_events(events: Events, clock: Clock, cycles: int) -> HeldPlanes:
    """The planes of events that are sent only where a width has changed: until its next event a
    pixel fires at the rate of the last width, or of the last reading of its charge."""
    held = Reported(*held_values(events, clock, cycles))
    return HeldPlanes(held, events.shape, clock, FINE)


def held_values(
    events: Events, clock: Clock, cycles: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Cycle, pixel and value of these events for `Reported`, of which FINE fires in every cycle."""
    share = np.ones(len(events)) if events.level is None else events.level / events.levels
    a_cycle = events.clock.hz / clock.hz  # ticks
    value = np.rint(np.minimum(FINE * share * a_cycle / events.width, 2.0 * FINE))
    cycle = latching_cycles(tick_ends(events.time, events.clock), clock, cycles)
    pixel = events.row.astype(np.int64) * events.shape[1] + events.column
    return cycle, pixel, value.astype(np.int64)


def held_reports(reports: Intensities, white: float, white_rate: float) -> HeldPlanes:
    """The planes of the reports of continuous pixels.

    Args:
        reports: electrons a second.
        white: value of white, electrons a second.
        white_rate: spikes a cycle of white.
    """
    value = np.rint(np.minimum(reports.value * (FINE * white_rate / white), 2.0 * FINE))
    held = Reported(reports.time, reports.pixel, value.astype(np.int64))
    return HeldPlanes(held, reports.shape, reports.clock, FINE)
