"""Optical cross-talk as an effect (the map is sensor/device/crosstalk.py)."""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import crosstalk_cost
from sensor.latched.effects.windows import made, shifted

__all__ = ["crosstalk_effect"]


def crosstalk_effect(crosstalk: float) -> Effect:
    """crosstalk: share of its light that a pixel loses to its neighbours."""

    def bound(scene: Summary) -> Bound:
        # A dark pixel among the brightest gets `crosstalk` of the difference.
        gained = crosstalk * (scene.brightest - scene.darkest)
        moved = shifted(scene, gained * scene.cycles / scene.threshold)
        return made(scene, scene.relative(gained) + moved, True)

    source = "Estribeau and Magnan, Proc. SPIE 5251:315, 2004, as one step of a random walk"
    return Effect("optical cross-talk", source, Stream.NONE, "", str, bound, crosstalk_cost)
