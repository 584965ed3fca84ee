"""Fixed pattern as effects: what leaving each part of `sensor.pattern` out would change."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.device.pattern import DevicePattern
from sensor.latched.effects.costs import pattern_cost
from sensor.latched.effects.windows import contrast, made, shifted

__all__ = ["pattern_effects"]


_NODES = 201
TILE_PIXELS = 256
"""Of a tile of the plan: where any pixel may be broken, a tile has at least one."""


def _effect(name: str, source: str, bound: Callable[[Summary], Bound]) -> Effect:
    """An effect that acts on the charge of a cycle before it begins: no stream, no kernel code."""
    return Effect(name, source, Stream.NONE, "", str, bound, pattern_cost, group="pattern")


def _inverse_spread(fpn: float) -> float:
    """RMS of 1 / max(1 + fpn z, 0.05) - 1 for normal z, as `DevicePattern.at` makes it."""
    z = np.linspace(-6, 6, _NODES)
    weight = np.exp(-z * z / 2)
    return float(np.sqrt(np.average((1 / np.maximum(1 + fpn * z, 0.05) - 1) ** 2, weights=weight)))


def pattern_effects(pattern: DevicePattern, period: float) -> tuple[Effect, ...]:
    """The effects of a device whose size is not zero. period: seconds in a cycle.

    Bounds are relative to a tile's rate, RMS over its pixels: the spread of a gain is its own
    bound, but for how light and gain meet; what does not scale with light counts most where it is
    darkest.
    """

    def gain(spread: float) -> Callable[[Summary], Bound]:
        def bound(scene: Summary) -> Bound:
            shift = spread * scene.brightest * scene.cycles / scene.threshold
            return made(
                scene, spread * contrast(scene) + shifted(scene, shift), False, spread < 0.04
            )

        return bound

    def dark(scene: Summary) -> Bound:
        charge = pattern.dark * period * math.hypot(1, pattern.dsnu)
        shift = charge * scene.cycles / scene.threshold
        proof = pattern.dsnu == 0 and pattern.threshold_fpn == 0
        return made(scene, scene.relative(charge) + shifted(scene, shift), proof)

    def broken(scene: Summary) -> Bound:
        share = [max(s, 1 / TILE_PIXELS) if s else 0.0 for s in (pattern.hot, pattern.dead)]
        hot = math.sqrt(share[0]) * scene.relative(pattern.hot_current * period)
        return made(scene, np.hypot(hot, math.sqrt(share[1]) * contrast(scene)), False, False)

    fpn = _inverse_spread(pattern.threshold_fpn)
    rows = (
        (pattern.prnu, "PRNU", "EMVA 1288 release 4.0", gain(pattern.prnu)),
        (pattern.dark, "dark current and DSNU", "Huang 2022 section 4.4; EMVA 1288", dark),
        (
            pattern.threshold_fpn,
            "threshold FPN",
            "comparator and capacitance mismatch",
            gain(fpn),
        ),
        (
            pattern.hot * pattern.hot_current + pattern.dead,
            "hot and dead pixels",
            "EMVA 1288",
            broken,
        ),
    )
    return tuple(_effect(name, source, bound) for size, name, source, bound in rows if size > 0)
