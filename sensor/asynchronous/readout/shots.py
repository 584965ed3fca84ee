"""Images of events at chosen instants, with the truth of the scene: TFI, one threshold over the
width that holds the instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Clock, Plane
from cosim.light.source import Source
from cosim.spikes.events import Events
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.reconstruct.fidelity import Estimate, to_white

Instants = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class EventShot:
    """One instant.

    Attributes:
        cycle: cycle of sensor.clock.
        truth, tfi: reflectance, and its estimate from the event that holds the instant, white = 1,
            (H, W).
    """

    cycle: int
    truth: Plane
    tfi: Estimate


def take_event_shots(
    events: Events, source: Source, clock: Clock, instants: list[int], model: EventModel,
    white: float,
) -> list[EventShot]:  # fmt: skip
    """TFI of each instant beside the truth. white: electrons a second of white."""
    shots = []
    for cycle in instants:
        middle = clock.middle(cycle)
        tick = int(latched(np.array([middle]), model.tick)[0])
        rate = rate_image(events, tick, model.threshold, model.delay / 1e12)
        shots.append(EventShot(cycle, source.truth(middle), to_white(rate, white)))
    return shots


def rate_image(events: Events, tick: int, threshold: float, delay: float = 0.0) -> np.ndarray:
    """Electrons a second of every pixel in a tick, (H, W) float64; 0 where nothing is known yet.

    Huang 2022 sections 3.3.2 and 5.2: the width of the event whose interval holds the tick, else
    that of the last event before it, which holds until something else is sent. A reading below
    threshold counts as the middle of its level, level 0 as nothing. delay: seconds of the
    comparator, in every spike's width; a reading is taken as the longest width is up.
    """
    height, width = events.shape
    place = events.row.astype(np.int64) * width + events.column
    cut = int(np.searchsorted(events.time, tick))
    chosen: npt.NDArray[np.int64] = np.full(height * width, -1, np.int64)
    chosen[place[:cut]] = np.arange(cut)  # of several the last is kept
    after = np.full(height * width, -1, np.int64)
    after[place[cut:][::-1]] = np.arange(cut, len(events))[::-1]
    begins = events.time[after] - events.width[after] if len(events) else after
    holds = (after >= 0) & (begins < tick)
    chosen = np.where(holds, after, chosen)
    known = chosen >= 0
    rate = np.zeros(height * width)
    at = chosen[known]
    seconds = events.width[at] * float(events.clock.period)
    charge = np.full(at.size, float(threshold))
    if events.level is None:
        seconds -= delay
    else:
        seconds -= np.where(events.level[at] == events.levels, delay, 0.0)
        level = events.level[at].astype(np.float64)
        share = np.where(level == 0, 0.0, (level + 0.5) / events.levels)
        charge *= np.where(level == events.levels, 1.0, share)
    rate[known] = charge / np.maximum(seconds, 1e-15)
    return rate.reshape(height, width)


def first_instants(sent: Firings) -> Instants:
    """Instants at which pixels first fired, ps."""
    _, first = np.unique(sent.pixel, return_index=True)
    return sent.instant[first]
