"""Optical cross-talk as an effect (the map is sensor/crosstalk.py)."""

from __future__ import annotations

import math

from cosim.effects import Bound, Effect, Summary
from cosim.streams import Stream

__all__ = ["crosstalk_effect"]


def crosstalk_effect(crosstalk: float) -> Effect:
    """crosstalk: share of its light that a pixel loses to its neighbours."""

    def bound(scene: Summary) -> Bound:
        # A dark pixel among the brightest gets `crosstalk` of the difference.
        if scene.darkest <= 0:
            return Bound(math.inf if scene.brightest > 0 else 0.0, "proof")
        return Bound(crosstalk * (scene.brightest / scene.darkest - 1), "proof")

    source = "Estribeau and Magnan, Proc. SPIE 5251:315, 2004, as one step of a random walk"
    return Effect("optical cross-talk", source, Stream.NONE, "", str, bound)
