"""Which effects are left out in which tile.

In every tile the set of effects is left out that saves the most work, while the sum of their bounds
(an estimate counts twice) is at most half the tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim.plan.error import EVERYTHING
from sensor.asynchronous.plan.effects import EventEffect, EventScene, event_effects
from sensor.device.pattern import DevicePattern

Reals = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.uint32]
LATER = "later reports"


@dataclass(frozen=True, eq=False)
class EventPlan:
    """Effects, tile by tile.

    Attributes:
        scene: what bounds are computed from.
        effects: all that the camera has.
        bounds: bounds of what leaving an effect out changes, relative, (effects, tiles).
        left_out: whether it is, (effects, tiles) bool.
    """

    scene: EventScene
    effects: tuple[EventEffect, ...]
    bounds: Reals
    left_out: npt.NDArray[np.bool_]

    def where(self, name: str) -> npt.NDArray[np.bool_]:
        """(tiles,) in which an effect is left out."""
        return np.asarray(self.left_out[[e.name for e in self.effects].index(name)])

    def without(self, names: set[str]) -> EventPlan:
        """The plan with these effects kept everywhere. Where shot noise comes back, later reports
        do: they were left out as there were none."""
        if "shot noise" in names:
            names = names | {LATER}
        keep = np.array([e.name in names for e in self.effects])
        return replace(self, left_out=self.left_out & ~keep[:, None])

    def keeping(self, effects: Iterable[str]) -> EventPlan:
        """The plan with these effects kept everywhere; EVERYTHING stands for all."""
        names = set(effects)
        return self.without({e.name for e in self.effects} if EVERYTHING in names else names)

    def acting(self, channel: bool) -> list[str]:
        """Effects that act in some pixel, by name. channel: whether all pixels share one."""
        pairs = zip(self.effects, self.left_out, strict=True)
        return [e.name for e, out in pairs if not out.all()] + ["shared channel"] * channel

    def shares(self) -> list[float]:
        """Share of all pixels in which each effect acts."""
        pixels = self.scene.pixels
        return [1 - float(pixels[out].sum() / pixels.sum()) for out in self.left_out]

    def names(self, tile: int) -> frozenset[str]:
        """What is left out in a tile."""
        return frozenset(e.name for e, out in zip(self.effects, self.left_out, strict=True)
                         if out[tile])  # fmt: skip

    @property
    def total(self) -> Reals:
        """(tiles,) sum of the bounds of what is left out; estimates count twice."""
        return np.asarray((np.where(self.left_out, self.bounds, 0.0) * _twice(self.effects)).sum(0))


def _twice(effects: tuple[EventEffect, ...]) -> Reals:
    return np.array([[2.0 if e.kind == "estimate" else 1.0] for e in effects])


def make_plan(scene: EventScene, pattern: DevicePattern | None, tolerance: float) -> EventPlan:
    """A plan for a tolerance; 0 keeps everything, and so does light that changes, since only its
    beginning is known before the run."""
    effects = event_effects(scene.model, pattern)
    with np.errstate(invalid="ignore"):  # nothing of what has no bound
        bounds = np.array([e.bound(scene) for e in effects])
    bounds[np.isnan(bounds)] = np.inf
    left_out = np.zeros(bounds.shape, np.bool_)
    free = [n for n, e in enumerate(effects) if e.work > 0]
    if not free or tolerance <= 0 or not scene.steady:
        return EventPlan(scene, effects, bounds, left_out)
    names = [effects[n].name for n in free]
    sets = (np.arange(2 ** len(free))[:, None] >> np.arange(len(free))) & 1 == 1
    counted = (bounds * _twice(effects))[free]
    # Without shot noise all widths of a pixel are the same, and it sends once.
    once = np.zeros((len(sets), len(free)), np.bool_)
    if "shot noise" in names and LATER in names and not scene.model.longest:
        once[:, names.index(LATER)] = sets[:, names.index("shot noise")]
    saved = sets @ np.array([effects[n].work for n in free])
    best, chosen = np.zeros(bounds.shape[1]), np.zeros(bounds.shape[1], np.int64)
    for n, members in enumerate(sets):
        total = counted[members & ~once[n]].sum(0)
        better = (total <= tolerance / 2) & (saved[n] > best)
        best[better], chosen[better] = saved[n], n
    left_out[free] = sets[chosen].T
    bounds[free] = np.where(once[chosen].T & left_out[free], 0.0, bounds[free])
    return EventPlan(scene, effects, bounds, left_out)
