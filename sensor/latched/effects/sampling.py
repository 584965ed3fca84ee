"""Row-by-row sampling and comparator delay: the same light, seen at another time."""

from __future__ import annotations

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import sampling_cost
from sensor.latched.effects.windows import made, shifted

__all__ = ["comparator_delay_effect", "row_sampling_effect"]


def _shifted(cycles: float, scene: Summary) -> Bound:
    """A window that is moved by a share of a cycle gains at one end and loses at the other, at most
    the whole range of light for that long; where the light never changes, nothing."""
    span = (scene.brightest - scene.darkest) * cycles * (np.asarray(scene.planes) > 0)
    moved = shifted(scene, span / scene.threshold)
    return made(scene, scene.relative(span / scene.window) + moved, True)


def row_sampling_effect(skew: float) -> Effect:
    """skew: share of a cycle from the first row to the last."""
    source = "row selectors of EP4340384 and US12581222B2; whether SpikeTwo has them is not known"
    return Effect(
        "row-by-row sampling", source, Stream.NONE, "", str, lambda s: _shifted(skew, s),
        sampling_cost, group="sampling",
    )  # fmt: skip


def comparator_delay_effect(cycles: float) -> Effect:
    """cycles: delay in cycles."""
    source = "a latch that samples a delayed comparator: an offset of the sampling instant"
    return Effect(
        "comparator delay", source, Stream.NONE, "", str, lambda s: _shifted(cycles, s),
        sampling_cost, group="sampling",
    )  # fmt: skip
