"""Dead time: comparator delay and reset after each spike, in which light is lost."""

from __future__ import annotations

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import dead_time_cost
from sensor.latched.effects.windows import made, shifted

__all__ = ["dead_time_effect"]


def dead_time_effect(cycles: float) -> Effect:
    """cycles: dead time in cycles. The rate is 1 / (Q / light + dead time), so leaving it out adds
    at most light x dead time / Q of it; a window counts whole spikes."""

    def bound(scene: Summary) -> Bound:
        spikes = scene.brightest / scene.threshold
        # A window of n intervals on average may hold a spike more. Over a tile the mean of r^4 is
        # at most max(r)^3 mean(r), so relative to the mean the RMS of r^2 is max(r)^1.5 / its root.
        uneven = np.sqrt(scene.relative(scene.brightest))
        gained = (spikes + 1 / scene.window) * cycles * uneven
        moved = shifted(scene, spikes * spikes * cycles * scene.cycles)
        return made(scene, gained + moved, True)

    source = (
        "non-paralysable dead time (Knoll, Radiation Detection and Measurement, 4th ed., ch. 4)"
    )
    return Effect(
        "reset dead time", source, Stream.NONE, "", str, bound, dead_time_cost, scope="tile"
    )
