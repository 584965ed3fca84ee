"""Images of events at chosen instants, with the truth of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Clock, Events, Plane
from cosim.light.source import Source
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.readout.image import rate_image
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


def first_instants(sent: Firings) -> Instants:
    """Instants at which pixels first fired, ps."""
    _, first = np.unique(sent.pixel, return_index=True)
    return sent.instant[first]
