"""Which effects are left out in which tile, and the pixels of an array run by such a plan.

Tiles of one set of effects are run together, by the engine, or in closed form where a pixel sends
but once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.light.light import Light
from cosim.plan.effects import Effect
from cosim.plan.error import EVERYTHING
from cosim.plan.planner import EffectRow, Plan, make_plan
from cosim.stage import section
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.array import FEWER, AsynchronousPixels
from sensor.asynchronous.pixel.closed import ClosedPixels
from sensor.asynchronous.plan.effects import LATER, EventScene, event_effects
from sensor.device.pattern import DevicePattern

Reals = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class EventPlan:
    """The plan of an asynchronous camera.

    Attributes:
        scene: what bounds are computed from.
        effects: all that the camera has.
        plan: effects that each tile keeps.
    """

    scene: EventScene
    effects: tuple[Effect, ...]
    plan: Plan

    @property
    def left_out(self) -> npt.NDArray[np.bool_]:
        """Whether an effect is left out, (effects, tiles)."""
        return ~np.stack([self.plan.kept[effect.name] for effect in self.effects])

    def where(self, name: str) -> npt.NDArray[np.bool_]:
        """(tiles,) in which an effect is left out."""
        return ~self.plan.kept[name]

    def keeping(self, effects: Iterable[str]) -> EventPlan:
        """The plan with these effects kept everywhere; EVERYTHING stands for all. Those that were
        left out because another one was come back with it."""
        names = set(effects)
        if EVERYTHING in names:
            names = set(self.plan.kept)
        names |= {effect.name for effect in self.effects if effect.moot in names}
        return replace(self, plan=self.plan.keeping(names))

    def acting(self, channel: bool) -> list[str]:
        """Effects that act in some pixel, by name. channel: whether all pixels share one."""
        return [*self.plan.everywhere, *["shared channel"] * channel]

    @property
    def rows(self) -> list[EffectRow]:
        """Rows of the effects, with the share of pixels."""
        pixels, rows = self.scene.pixels, []
        for row in self.plan.rows:
            share = 1 - float(pixels[self.where(row.effect)].sum() / pixels.sum())
            rows.append(replace(row, kept=share))
        return rows

    @property
    def absent(self) -> list[EffectRow]:
        """Rows of the effects that some tile leaves out."""
        return [row for row in self.rows if row.effect in self.plan.left_out]

    def names(self, tile: int) -> frozenset[str]:
        """What is left out in a tile."""
        return frozenset(name for name, kept in self.plan.kept.items() if not kept[tile])


def plan_events(scene: EventScene, pattern: DevicePattern | None, tolerance: float) -> EventPlan:
    """A plan for a tolerance; 0 keeps everything, and so does light that changes, since only its
    beginning is known before the run."""
    effects = event_effects(scene.model, pattern)
    forced = [] if scene.steady else [effect.name for effect in effects]
    with np.errstate(invalid="ignore"):  # nothing of what has no bound
        return EventPlan(scene, effects, make_plan(effects, scene, tolerance, forced=forced))


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
    if "warm pixels" in names:
        pattern = replace(pattern, warm=0.0)
    none = pattern == DevicePattern(
        dsnu=pattern.dsnu, hot_current=pattern.hot_current, warm_current=pattern.warm_current,
        device_seed=pattern.device_seed,
    )  # fmt: skip
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
            if LATER in names:
                self._pixels.append(ClosedPixels(model, shape, gain, device, group))
            else:
                self._pixels.append(
                    AsynchronousPixels(model, shape, gain, device, most=most, numbers=group)
                )

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        state = {"fired": np.array(self._fired)}
        for n, pixels in enumerate(self._pixels):
            if isinstance(pixels, AsynchronousPixels):  # those that send once have no state
                state |= {f"{n}/{key}": value for key, value in pixels.state().items()}
        return state

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._fired = int(state["fired"])
        for n, pixels in enumerate(self._pixels):
            if isinstance(pixels, AsynchronousPixels):
                pixels.restore(section(state, f"{n}"))

    def step(self, light: Light, start: int, stop: int) -> Firings:
        """Firings after start, up to stop (ps). Raises InputError where they are too many."""
        parts = [pixels.unordered(light, start, stop) for pixels in self._pixels]
        self._fired += sum(len(part) for part in parts)
        if self._fired > self._most:
            raise InputError("the events", f"at most {self._most:,}", "more", FEWER)
        return Firings.join(parts).ordered()
