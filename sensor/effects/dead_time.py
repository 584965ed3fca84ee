"""Dead time: comparator delay and reset after each spike, in which light is lost."""

from __future__ import annotations

from cosim.effects import Bound, Effect, Summary
from cosim.streams import Stream

__all__ = ["dead_time_effect"]


def dead_time_effect(cycles: float) -> Effect:
    """cycles: dead time in cycles. The rate is 1 / (Q / light + dead time), so leaving it out adds
    at most light x dead time / Q of it."""

    def bound(scene: Summary) -> Bound:
        return Bound(scene.brightest * cycles / scene.threshold, "proof")

    source = (
        "non-paralysable dead time (Knoll, Radiation Detection and Measurement, 4th ed., ch. 4)"
    )
    return Effect("reset dead time", source, Stream.NONE, "", str, bound)
