"""What a pixel's circuit does to its rate, as effects: the lumped form of sensor/stiff."""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import circuit_cost
from sensor.latched.effects.windows import contrast, made, shifted

__all__ = ["leak_effect", "overshoot_effect"]


def overshoot_effect(electrons: float) -> Effect:
    """electrons: that an interval takes beyond its threshold. The rate is light / (Q + electrons):
    leaving it out changes it by electrons / Q of what is left."""

    def bound(scene: Summary) -> Bound:
        share = abs(electrons) / scene.threshold
        shift = share * scene.brightest * scene.cycles / scene.threshold
        return made(scene, share * contrast(scene) + shifted(scene, shift), True)

    source = "comparator of one pole on a ramp: late by trip / (gain x slope)"
    return Effect(
        "comparator overshoot", source, Stream.NONE, "", str, bound, circuit_cost, group="circuit"
    )


def leak_effect(electrons: float) -> Effect:
    """electrons: a cycle, negative: what leaks on average from an interval's charge."""

    def bound(scene: Summary) -> Bound:
        lost = abs(electrons)
        moved = shifted(scene, lost * scene.cycles / scene.threshold)
        return made(scene, scene.relative(lost) + moved, True)

    source = "mean of Q V(t) / tau over an interval: threshold / (2 tau) (sensor/circuit/lumped.py)"
    return Effect("leak", source, Stream.NONE, "", str, bound, circuit_cost, group="circuit")
