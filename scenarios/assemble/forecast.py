"""What `viform plan` says: the plan of a run, and what it would take on this device."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim import BLOCK, Block, Light
from cosim.compute.opencl import Device
from cosim.light.light import PlaneMap
from scenarios.assemble.filming import WiderStage
from scenarios.assemble.planning import RunPlan, plan_run
from scenarios.assemble.prepare import look_at, look_through, prepare_camera, scene_source
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting, SpikeCamera
from sensor.latched.patches import PatchCamera, PatchPlane

__all__ = ["forecast", "forecast_events"]

BLOCKS = 2
"""Blocks of the scene's beginning that are run; the first warms up, the second is timed."""
REFERENCE_TILES = 12
"""Tiles on which full physics is timed."""


@dataclass(frozen=True)
class _Measured:
    """Nanoseconds a pixel-cycle: of the camera as planned, with everything kept, of full physics,
    and of making the light."""

    planned: float
    everything: float
    full: float
    scene: float


def _measure(
    scenario: Scenario, setting: CameraSetting, relay: Callable[[Light], Light], plan: RunPlan,
    everything: RunPlan, device: Device | None,
) -> _Measured:  # fmt: skip
    grid, cycles = plan.look.grid, plan.look.scene.cycles
    size = min(BLOCK, max(cycles // BLOCKS, 1))
    wider = WiderStage(scene_source(scenario, setting, cycles), setting.reach)
    whole = np.flatnonzero(grid.whole)
    plane = PatchPlane(grid, whole[:: max(len(whole) // REFERENCE_TILES, 1)].tolist())
    cut = PlaneMap(plane.cut, None)
    reference = PatchCamera(setting, plane, "reference")
    cameras = [
        SpikeCamera(run.setting, device, tier=run.tier, flags=run.flags)
        for run in (plan, everything)
    ]
    spent = [0.0] * 4
    pixels = grid.height * grid.width
    for start in range(0, BLOCKS * size, size):
        begin = time.perf_counter()
        light = relay(wider.step(None, Block(start, size)))
        spent[3] = (time.perf_counter() - begin) / pixels
        for n, camera in enumerate(cameras):
            begin = time.perf_counter()
            camera.step(light, Block(start, size))
            spent[n] = (time.perf_counter() - begin) / pixels
        patches = cut(light)
        begin = time.perf_counter()
        reference.step(patches, start, size)
        spent[2] = (time.perf_counter() - begin) / plane.numbers.size
    return _Measured(*(s * 1e9 / size for s in spent))


def _display(scenario: Scenario, run: RunPlan) -> dict[str, Any] | None:
    """The display as planned, in words; None where there is none."""
    if run.display is None or scenario.display is None:
        return None
    return {
        "drive": run.display.panel.drive, "observer": scenario.display.observer,
        "planes_to_a_span": run.display.batch,
    }  # fmt: skip


def forecast(name: str, scenario: Scenario, device_name: str | None) -> dict[str, Any]:
    """The document of `viform plan --json`."""
    setting, cycles, instants, lens, white, device = prepare_camera(scenario, device_name)
    seen = look_at(scenario, setting, lens, cycles)
    shown = look_through(scenario, setting, white, instants, cycles)[0]
    run = plan_run(seen, setting, scenario.tolerance, instants, device, display=shown)
    everything = plan_run(seen, setting, 0.0, instants, device, tier=run.tier, display=shown)
    relay = lens.relay(setting.chip.pitch)
    took = _measure(scenario, setting, relay, run, everything, device)
    total = setting.chip.width * setting.chip.height * cycles * 1e-9
    plan = run.plan
    return {
        "scenario": name,
        "tolerance": scenario.tolerance,
        "tier": run.tier,
        "device": device.name if device is not None else "numba on this processor",
        "tiles": seen.classes,
        "display": _display(scenario, run),
        "kept": list(plan.everywhere),
        "left_out": [
            {"effect": r.effect, "bound": r.bound, "kind": r.kind, "share": 1 - r.kept}
            for r in plan.rows if r.effect in plan.left_out
        ],
        "promised": float(plan.total.max()) + run.own,
        "promised_kind": plan.kind if run.own == 0 else "estimate",
        "rows": [asdict(row) for row in plan.rows],
        "sets": [
            {"effects": list(effects), "tiles": count} for effects, count in plan.sets.items()
        ],
        "predicted": {
            "ns_per_pixel_cycle": took.planned,
            "sensor_s": took.planned * total,
            "scene_s": took.scene * total,
            "everything_ns_per_pixel_cycle": took.everything,
            "everything_s": took.everything * total,
            "full_physics_ns_per_pixel_cycle": took.full,
            "full_physics_s": took.full * total,
        },
    }  # fmt: skip


def forecast_events(name: str, scenario: Scenario) -> dict[str, Any]:
    """The document of `viform plan --json` for asynchronous pixels, whose own time hangs on the
    events and is not predicted."""
    from scenarios.assemble.event_plan import begin_events, plan_events
    from sensor.asynchronous.cost import reference_cost

    rows, start = plan_events(scenario), begin_events(scenario)
    view = start.view
    cost = reference_cost(start.model, view, start.plan(scenario.tolerance), 1)
    full = cost.seconds * start.stop / (view.until - view.light.pieces[0].start)
    return {
        "scenario": name,
        "tolerance": scenario.tolerance,
        "tier": "fast" if scenario.tolerance > 0 else "exact",
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
