"""Which effects are left out in which tile, and the pixels that are run so.

In every tile the set of effects is left out that saves the most work, while the sum of their bounds
(an estimate counts twice) is at most half the tolerance. Tiles of one set are run together: by the
engine, or in closed form where a pixel sends but once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.light.light import Light
from sensor.asynchronous.closed import ClosedPixels
from sensor.asynchronous.effects import EventEffect, EventScene, event_effects
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixels import FEWER, AsynchronousPixels
from sensor.device.pattern import DevicePattern

__all__ = ["EVERYTHING", "EventPlan", "PlannedPixels", "make_plan", "reduced"]

Reals = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.uint32]
_LATER = "later reports"
EVERYTHING: Final = "every effect"
"""Stands for all effects where they are kept."""


@dataclass(frozen=True, eq=False)
class EventPlan:
    """effects: all that act. bounds: (effects, tiles). left_out: (effects, tiles) bool."""

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
            names = names | {_LATER}
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
    if "shot noise" in names and _LATER in names and not scene.model.longest:
        once[:, names.index(_LATER)] = sets[:, names.index("shot noise")]
    saved = sets @ np.array([effects[n].work for n in free])
    best, chosen = np.zeros(bounds.shape[1]), np.zeros(bounds.shape[1], np.int64)
    for n, members in enumerate(sets):
        total = counted[members & ~once[n]].sum(0)
        better = (total <= tolerance / 2) & (saved[n] > best)
        best[better], chosen[better] = saved[n], n
    left_out[free] = sets[chosen].T
    bounds[free] = np.where(once[chosen].T & left_out[free], 0.0, bounds[free])
    return EventPlan(scene, effects, bounds, left_out)


def reduced(
    model: EventModel, pattern: DevicePattern | None, names: frozenset[str]
) -> tuple[EventModel, DevicePattern | None]:
    """The pixel and the device without these effects."""
    if "shot noise" in names:
        model = replace(model, shot=False)
    if pattern is None:
        return model, None
    if "PRNU" in names:
        pattern = replace(pattern, prnu=0.0)
    if "dark current and DSNU" in names:
        pattern = replace(pattern, dark=0.0)
    if "threshold FPN" in names:
        pattern = replace(pattern, threshold_fpn=0.0)
    if "hot and dead pixels" in names:
        pattern = replace(pattern, hot=0.0, dead=0.0)
    none = pattern == DevicePattern(dsnu=pattern.dsnu, hot_current=pattern.hot_current,
                                    device_seed=pattern.device_seed)  # fmt: skip
    return model, None if none else pattern


class PlannedPixels:
    """Pixels of `shape` run by a plan. numbers: those that are run, all unless given."""

    def __init__(
        self,
        plan: EventPlan,
        pattern: DevicePattern | None,
        shape: tuple[int, int],
        gain: float,
        *,
        most: int = 20_000_000,
        numbers: Numbers | None = None,
    ) -> None:
        self.shape, self._most, self._fired = shape, most, 0
        self.groups: list[tuple[Numbers, EventModel, DevicePattern | None]] = []
        self._pixels: list[AsynchronousPixels | ClosedPixels] = []
        if numbers is None:
            numbers = np.arange(shape[0] * shape[1], dtype=np.uint32)
        bits = 1 << np.arange(len(plan.effects), dtype=np.int64)
        kinds, like, of_tile = np.unique(
            (plan.left_out * bits[:, None]).sum(0), return_index=True, return_inverse=True
        )
        mine = of_tile.astype(np.uint8)[plan.scene.tile_of[numbers]]
        for kind in range(kinds.size):
            group = numbers[mine == kind] if kinds.size > 1 else numbers
            if not group.size:
                continue
            names = plan.names(int(like[kind]))
            model, device = reduced(plan.scene.model, pattern, names)
            self.groups.append((group, model, device))
            if _LATER in names:
                self._pixels.append(ClosedPixels(model, shape, gain, device, group))
            else:
                self._pixels.append(
                    AsynchronousPixels(model, shape, gain, device, most=most, numbers=group)
                )

    def step(self, light: Light, start: int, stop: int) -> Firings:
        """Firings after start, up to stop (ps). Raises InputError where they are too many."""
        parts = [pixels.unordered(light, start, stop) for pixels in self._pixels]
        self._fired += sum(len(part) for part in parts)
        if self._fired > self._most:
            raise InputError("the events", f"at most {self._most:,}", "more", FEWER)
        made = Firings.join(parts)
        return made.take(np.lexsort((made.pixel, made.instant)))
