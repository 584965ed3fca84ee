"""The plan of an imager's run: which effects its light and exposures need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cosim import seconds_to_ps
from cosim.plan.planner import Plan, make_plan
from rtl_model.imagers.run.machine import Expected, Machine
from rtl_model.imagers.run.view import View, make_view
from scenarios.assemble.scenario import ImagerScenario
from sensor.imagers import ImagerSummary, PixelModel

__all__ = ["Ready", "forecast_imager", "plan_all", "plan_imager", "ready_imager"]


@dataclass(frozen=True, eq=False)
class Ready:
    """A run that has been checked and planned. stop: ps."""

    name: str
    scenario: ImagerScenario
    machine: Machine
    view: View
    expected: Expected
    summary: ImagerSummary
    plan: Plan
    pixels: PixelModel
    stop: int

    @property
    def kept(self) -> frozenset[str]:
        return frozenset(self.plan.everywhere)


def plan_imager(
    pixels: PixelModel, summary: ImagerSummary, tolerance: float, certain: bool,
    forced: Sequence[str] = (),
) -> Plan:  # fmt: skip
    """Over the whole plane and run at once: effects of an imager are the whole plane's."""
    effects = list(pixels.effects.values())
    return make_plan(effects, summary, tolerance, certain=np.array([certain]), forced=forced)


def plan_all(
    models: Sequence[PixelModel], expected: Expected, tolerance: float, certain: bool,
    forced: Sequence[str] = (),
) -> tuple[Plan, ImagerSummary]:  # fmt: skip
    """The plan of a run whose pixels work in several settings: what one of them needs is kept in
    all. Each effect's bound is told of the setting in which it is largest."""
    need = set(forced)
    found: list[tuple[Plan, ImagerSummary]] = []
    for _ in range(2):  # what the others need is known the second time
        found = []
        for pixels in models:
            summary = pixels.summary(expected.lux_seconds, expected.seconds, expected.frames)
            found.append((plan_imager(pixels, summary, tolerance, certain, sorted(need)), summary))
        need |= {name for plan, _ in found for name in plan.everywhere}
        if len(models) == 1:
            break
    plan, summary = max(found, key=lambda each: float(each[0].total.max()))
    rows = tuple(max(same, key=lambda row: row.bound)
                 for same in zip(*(p.rows for p, _ in found), strict=True))  # fmt: skip
    return replace(plan, rows=rows), summary


def ready_imager(
    name: str, scenario: ImagerScenario, machine: Machine, forced: Sequence[str] = ()
) -> Ready:
    """Raises InputError for what cannot be run."""
    view = make_view(scenario, machine.shape)
    stop = seconds_to_ps(scenario.duration)
    pixels = machine.make().pixels  # refuses what the imager cannot do, before it is foreseen
    expected = machine.expected(view, stop)
    plan, summary = plan_all(
        machine.models(pixels), expected, scenario.tolerance, view.certain, forced
    )
    return Ready(name, scenario, machine, view, expected, summary, plan, pixels, stop)


def forecast_imager(name: str, scenario: ImagerScenario, machine: Machine) -> dict[str, Any]:
    """The document of `viform plan --json`, which simulates nothing: what would be kept, and what
    it would take by the effects' own table of costs."""
    run = ready_imager(name, scenario, machine)
    plan, (rows, columns) = run.plan, machine.shape
    per_cycle = rows * columns * run.expected.frames * 1e-9
    low, high = run.expected.lux_seconds
    return {
        "scenario": name,
        "tolerance": scenario.tolerance,
        "imager": scenario.imager.kind,
        "tier": "exact",
        "device": "numba on this processor",
        "tiles": {},
        "expected": {
            "frames": run.expected.frames,
            "lux_seconds": [low, high],
            "exposure_s": list(run.expected.seconds),
            "photoelectrons": [float(run.summary.darkest), float(run.summary.brightest)],
        },
        "kept": list(plan.everywhere),
        "left_out": [
            {"effect": r.effect, "bound": r.bound, "kind": r.kind, "share": 1 - r.kept}
            for r in plan.rows if r.effect in plan.left_out
        ],
        "promised": float(plan.total.max()),
        "promised_kind": plan.kind,
        "rows": [asdict(row) for row in plan.rows],
        "sets": [
            {"effects": list(effects), "tiles": count} for effects, count in plan.sets.items()
        ],
        "predicted": {
            "ns_per_pixel_cycle": plan.cost_ns,
            "sensor_s": plan.cost_ns * per_cycle,
            "scene_s": None,
            "everything_ns_per_pixel_cycle": plan.full_ns,
            "everything_s": plan.full_ns * per_cycle,
            "full_physics_ns_per_pixel_cycle": plan.full_ns,
            "full_physics_s": plan.full_ns * per_cycle,
        },
    }  # fmt: skip
