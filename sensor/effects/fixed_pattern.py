"""Fixed pattern as effects: what leaving each part of `sensor.pattern` out would change."""

from __future__ import annotations

import math
from collections.abc import Callable

from cosim.effects import Bound, Effect, Summary
from cosim.streams import Stream
from sensor.pattern import DevicePattern

__all__ = ["pattern_effects"]


def _effect(name: str, source: str, bound: Callable[[Summary], Bound]) -> Effect:
    """An effect that acts on the charge of a cycle, on the host: no stream, no kernel code."""
    return Effect(name, source, Stream.NONE, "", str, bound)


def pattern_effects(pattern: DevicePattern, period: float) -> tuple[Effect, ...]:
    """The effects of a device whose size is not zero. period: seconds in a cycle.

    Bounds are relative to a pixel's rate, RMS over pixels: the spread of a gain is its own bound;
    what does not scale with light counts most where it is darkest.
    """

    def dark(scene: Summary) -> Bound:
        charge = pattern.dark * period * math.hypot(1, pattern.dsnu)
        return Bound(charge / scene.darkest if scene.darkest > 0 else math.inf, "proof")

    def broken(scene: Summary) -> Bound:
        hot = pattern.hot_current * period / scene.darkest if scene.darkest > 0 else math.inf
        hot = math.sqrt(pattern.hot) * hot if pattern.hot and pattern.hot_current else 0.0
        return Bound(math.hypot(hot, math.sqrt(pattern.dead)), "estimate")

    made = (
        (pattern.prnu, "PRNU", "EMVA 1288 release 4.0", lambda _: Bound(pattern.prnu, "proof")),
        (pattern.dark, "dark current and DSNU", "Huang 2022 section 4.4; EMVA 1288", dark),
        (
            pattern.threshold_fpn,
            "threshold FPN",
            "comparator and capacitance mismatch",
            lambda _: Bound(pattern.threshold_fpn, "estimate"),
        ),
        (
            pattern.hot * pattern.hot_current + pattern.dead,
            "hot and dead pixels",
            "EMVA 1288",
            broken,
        ),
    )
    return tuple(_effect(name, source, bound) for size, name, source, bound in made if size > 0)
