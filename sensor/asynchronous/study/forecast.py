"""The document of `viform plan` for an asynchronous camera."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from cosim import PS
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.pixel.closed import ClosedPixels
from sensor.asynchronous.plan.cost import least, reference_cost
from sensor.asynchronous.plan.plan import EventPlan
from sensor.asynchronous.plan.planned import reduced
from sensor.asynchronous.run import EventStart
from sensor.asynchronous.setting import channel_model

_SAMPLE: Final = 4096
"""Pixels that costs are measured on."""
_SPIKES: Final = 500_000
"""Upper limit of the spikes of these pixels, where each is simulated by itself."""
_SKIPS: Final = 4.0
"""`EventModel.change` from which on at most one spike in 256 is reported."""
_CALLS: Final = 3


def forecast_events(start: EventStart) -> dict[str, Any]:
    """What a run would keep and leave out, and what full physics would take.

    The camera's own time depends on the number of events and is not predicted.
    """
    spec, view = start.spec, start.view
    plan = start.plan(spec.tolerance)
    rows = plan_rows(start, plan)
    cost = reference_cost(spec.model, view, plan, 1)
    full = cost.seconds * spec.stop / (view.until - view.light.pieces[0].start)
    return {
        "scenario": spec.name,
        "tolerance": spec.tolerance,
        "tier": "fast" if spec.tolerance > 0 else "exact",
        "device": "numba on this processor",
        "tiles": {},
        "kept": [row["effect"] for row in rows if row["kept"]],
        "left_out": [
            {"effect": r["effect"], "bound": r["bound"], "kind": r["kind"], "share": 1 - r["share"]}
            for r in rows if r["share"] < 1
        ],
        "promised": None,
        "promised_kind": None,
        "rows": [
            {
                "effect": r["effect"], "kept": r["share"], "bound": r["bound"], "kind": r["kind"],
                "cost_ns": r["cost_ns"],
            }
            for r in rows
        ],
        "sets": [],
        "predicted": {"sensor_s": None, "full_physics_s": full},
    }  # fmt: skip


def plan_rows(start: EventStart, plan: EventPlan) -> list[dict[str, Any]]:
    """Rows {effect, kept, share, bound, kind, cost_ns} of a plan.

    kept: whether the effect acts in some pixel; share: in which share of them; bound: the largest
    of the tiles that leave it out, or of all tiles, None for none; cost_ns: per pixel and cycle of
    sensor.clock.
    """
    costs, rows = _costs(start, plan), []
    parts = zip(plan.effects, plan.bounds, plan.left_out, plan.shares(), strict=True)
    for effect, bounds, out, share in parts:
        bound = float(bounds[out].max() if out.any() else bounds.max())
        rows.append({
            "effect": effect.name, "kept": share > 0, "share": share,
            "bound": bound if np.isfinite(bound) else None, "kind": effect.kind,
            "cost_ns": costs[effect.name],
        })  # fmt: skip
    return [*rows, *_channel_rows(start)]


def _channel_rows(start: EventStart) -> list[dict[str, Any]]:
    """The shared channel, which delays events and loses those that find their place taken. A
    pixel's own place is free for its first report, and its time stamp is not late."""
    sensor, channel = start.spec.section, channel_model(start.spec.section)
    if channel is None or sensor.channel is None:
        return []
    harmless = channel.buffer == "pixel" and sensor.channel.timestamp == "pixel"
    harmless = harmless and start.spec.model.change > 0
    return [{
        "effect": "shared channel", "kept": True, "share": 1.0,
        "bound": 0.0 if harmless else None, "kind": "proof" if harmless else "estimate",
        "cost_ns": 0.0,
    }]  # fmt: skip


def _costs(start: EventStart, plan: EventPlan) -> dict[str, float]:
    """Nanoseconds per pixel and cycle of each effect: the difference of the times with and without
    it, on evenly chosen pixels. An effect that is part of a formula of others costs nothing."""
    view, clock = start.view, start.spec.setting.clock
    scene, n = plan.scene, plan.scene.tile_of.size
    numbers = np.unique(np.linspace(0, n - 1, _SAMPLE).astype(np.uint32))
    begin, stop = view.light.pieces[0].start, view.until
    fires = float(scene.mean[scene.tile_of[numbers]].sum())
    if scene.model.change < _SKIPS and fires > 0:
        stop = min(stop, begin + max(round(_SPIKES / fires * PS), 1))
    costs: dict[str, float] = {}

    def engine(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: AsynchronousPixels(
            model, view.shape, view.gain, device, numbers=numbers
        ).unordered(view.light, begin, stop)

    def closed(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: ClosedPixels(model, view.shape, view.gain, device, numbers).unordered(
            view.light, begin, stop
        )

    once = bool(scene.model.change and not scene.model.longest and scene.steady)
    run = closed if once else engine
    everything = frozenset(e.name for e in plan.effects)
    bare = least(run(everything), _CALLS)
    for effect in plan.effects:
        spent = 0.0
        if effect.name == "later reports" and once:
            spent = least(engine(frozenset()), _CALLS) - least(closed(frozenset()), _CALLS)
        elif effect.name != "later reports" and effect.work > 0:
            spent = least(run(everything - {effect.name}), _CALLS) - bare
        per_second = numbers.size * clock.hz * (stop - begin) / PS
        costs[effect.name] = max(spent, 0.0) * 1e9 / per_second
    return costs
