"""The plan of a run with asynchronous readout: what is kept where, and what that saves."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import PS, Clock, Light, seconds_to_ps
from scenarios.assemble.camera import choose_lens
from scenarios.assemble.event_camera import channel_model, event_model, event_setting, with_defaults
from scenarios.assemble.readout import light_steps, make_relay
from scenarios.assemble.scenario import Scenario
from scenarios.scenes import make_source
from sensor import CameraSetting
from sensor.asynchronous import (
    AsynchronousPixels,
    EventModel,
    EventPlan,
    is_steady,
    make_plan,
    summarise,
)
from sensor.asynchronous.closed import ClosedPixels
from sensor.asynchronous.plan import reduced
from sensor.asynchronous.verify import Checked, View

__all__ = [
    "EventStart",
    "begin_events",
    "kept_names",
    "plan_events",
    "plan_notes",
    "plan_of",
    "view_of",
]

_SAMPLE = 4096
"""Pixels that costs are measured on."""
_SPIKES = 500_000
"""Of these pixels, at most, where every one is run by itself."""
_SKIPS = 4.0
"""`EventModel.change` from which on hardly any is: a report in 256 or fewer."""


def plan_of(
    model: EventModel, setting: CameraSetting, light: Light, stop: int, tolerance: float
) -> EventPlan:
    """The plan for a run that ends at `stop` (ps), from the light it begins with."""
    rate = light.pieces[0].first.ravel().astype(np.float64) * setting.electrons_per_lux
    shape = (setting.chip.height, setting.chip.width)
    scene = summarise(model, setting.pattern, rate, shape, stop, is_steady(light, stop))
    return make_plan(scene, setting.pattern, tolerance)


def view_of(setting: CameraSetting, light: Light, until: int) -> View:
    """What a plan is verified on."""
    shape = (setting.chip.height, setting.chip.width)
    return View(
        light, until, shape, setting.electrons_per_lux, setting.pattern, setting.seed
    )  # fmt: skip


@dataclass(frozen=True)
class EventStart:
    """A scenario as it is known before it is run. stop: its end, ps."""

    model: EventModel
    setting: CameraSetting
    view: View
    stop: int

    def plan(self, tolerance: float) -> EventPlan:
        return plan_of(self.model, self.setting, self.view.light, self.stop, tolerance)

    @property
    def cycles(self) -> int:
        """Cycles of sensor.clock as far as the light is known, the last one begun."""
        return max(self.setting.clock.cycle_at(self.view.until - 1) + 1, 1)


def begin_events(scenario: Scenario) -> EventStart:
    """Raises InputError for what a run would refuse."""
    scenario = with_defaults(scenario)
    setting = event_setting(scenario)
    model = event_model(scenario, setting)
    stop = seconds_to_ps(scenario.duration)
    cycles = setting.clock.cycle_at(stop - 1) + 1
    shape = (setting.chip.height, setting.chip.width)
    source = make_source(scenario.scene, shape, setting.clock, cycles, aligned=False)
    relay = make_relay(choose_lens(scenario, setting), setting)
    light, _, until = next(light_steps(source, relay, setting.clock, stop))
    return EventStart(model, setting, view_of(setting, light, until), stop)


def _channel_row(scenario: Scenario, plan: EventPlan) -> dict[str, Any] | None:
    """The shared channel: it delays events and loses those that find their place taken. A pixel's
    own place is free for its first report, and its stamp is not late."""
    channel = channel_model(scenario)
    if channel is None or scenario.sensor.channel is None:
        return None
    harmless = channel.buffer == "pixel" and scenario.sensor.channel.timestamp == "pixel"
    harmless = harmless and plan.scene.model.change > 0
    return {
        "effect": "shared channel", "kept": True, "share": 1.0,
        "bound": 0.0 if harmless else None, "kind": "proof" if harmless else "estimate",
        "cost_ns": 0.0,
    }  # fmt: skip


def kept_names(plan: EventPlan, channel: bool) -> list[str]:
    """Effects that act in some pixel, by name."""
    names = [e.name for e, out in zip(plan.effects, plan.left_out, strict=True) if not out.all()]
    return names + ["shared channel"] * channel


def plan_notes(checked: Checked) -> list[str]:
    """What a user must know: how much of the array does without what, and broken promises."""
    plan, pixels = checked.plan, checked.plan.scene.pixels
    shares = [
        f"{effect.name} in {float(pixels[out].sum() / pixels.sum()):.0%}"
        for effect, out in zip(plan.effects, plan.left_out, strict=True)
        if out.any()
    ]
    told = [f"left out, of all pixels: {', '.join(shares)}"] if shares else []
    return [*told, *checked.broken]


def _least(call: Callable[[], object]) -> float:
    """Seconds: one call discarded, the least of three."""
    call()
    spent = []
    for _ in range(3):
        begin = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begin)
    return min(spent)


def _costs(plan: EventPlan, view: View, clock: Clock) -> dict[str, float]:
    """Nanoseconds a pixel and cycle that each effect takes, measured on pixels evenly chosen, with
    it and without it. What is part of one formula is not told apart: nothing."""
    scene, n = plan.scene, plan.scene.tile_of.size
    numbers = np.unique(np.linspace(0, n - 1, _SAMPLE).astype(np.uint32))
    start, stop = view.light.pieces[0].start, view.until
    fires = float(scene.mean[scene.tile_of[numbers]].sum())
    if scene.model.change < _SKIPS and fires > 0:
        stop = min(stop, start + max(round(_SPIKES / fires * PS), 1))
    made: dict[str, float] = {}

    def engine(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: AsynchronousPixels(
            model, view.shape, view.gain, device, numbers=numbers
        ).unordered(view.light, start, stop)

    def closed(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: ClosedPixels(model, view.shape, view.gain, device, numbers).unordered(
            view.light, start, stop
        )

    once = bool(scene.model.change and not scene.model.longest and scene.steady)
    run = closed if once else engine
    everything = frozenset(e.name for e in plan.effects)
    bare = _least(run(everything))
    for effect in plan.effects:
        if effect.name == "later reports":
            spent = _least(engine(frozenset())) - _least(closed(frozenset())) if once else 0.0
        elif effect.work > 0:
            spent = _least(run(everything - {effect.name})) - bare
        else:
            spent = 0.0
        made[effect.name] = max(spent, 0.0) * 1e9 / (numbers.size * clock.hz * (stop - start) / PS)
    return made


def plan_events(scenario: Scenario) -> list[dict[str, Any]]:
    """Rows {effect, kept, share, bound, kind, cost_ns}: whether an effect acts in some pixel, in
    which share of them, the largest bound where it is left out (where it is not, of all tiles;
    None where there is none), and nanoseconds a pixel and cycle of sensor.clock that it takes.

    Raises InputError for what a run would refuse.
    """
    start = begin_events(scenario)
    plan = start.plan(scenario.tolerance)
    costs, rows = _costs(plan, start.view, start.setting.clock), []
    for effect, bounds, out in zip(plan.effects, plan.bounds, plan.left_out, strict=True):
        bound = float(bounds[out].max() if out.any() else bounds.max())
        share = 1 - float(plan.scene.pixels[out].sum() / plan.scene.pixels.sum())
        rows.append({
            "effect": effect.name, "kept": share > 0, "share": share,
            "bound": bound if np.isfinite(bound) else None, "kind": effect.kind,
            "cost_ns": costs[effect.name],
        })  # fmt: skip
    channel = _channel_row(scenario, plan)
    return rows if channel is None else [*rows, channel]
