"""Error against run time: every tier at a ladder of tolerances, on one scenario.

The error of a row is that of its plan against the reference on patches, over the scenario's image
windows, with the same random counters. Its time is the camera's alone: the least of consecutive
blocks of the whole chip, in the middle of the run, after a block that is thrown away. All rows see
the same light, which is made once; evaluating errors is not timed.

Where the scenario has a display, an error is of radiance as its observer integrates it, against the
reference camera on the golden display, and a row's time is that of the camera and of the renderer
on the same blocks; the reference's display is the golden model.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import BLOCK, Block
from cosim.compute.opencl import Device
from cosim.plan.order import fit_order
from cosim.run.progress import Progress
from cosim.spikes.viform import Words
from display import DisplaySetting
from display.trial.cost import display_ns, golden_ns
from scenarios.assemble.filming import WiderStage
from scenarios.assemble.planning import RunPlan, plan_run
from scenarios.assemble.prepare import look_at, look_through, prepare_camera, scene_source
from scenarios.assemble.scenario import Scenario
from scenarios.assemble.shown import TRUTH, ShownPaired, ShownPatches
from scenarios.assemble.verifier import Planned
from sensor import CameraSetting, SpikeCamera
from sensor.latched.paired import Paired, windows, worst
from sensor.latched.patches import PatchCamera, PatchPlane
from sensor.latched.tiers import Tier

__all__ = ["DRAWS", "LADDER", "Row", "accuracy", "fit_rows", "reference_error"]

LADDER = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
"""Tolerances that are tried. One that gives the plan of a tighter one is not filmed again."""
TIMED = 3
"""Blocks of the whole chip that are timed, after one that is not."""
DRAWS = 256
"""Thresholds that the reference is held to its law on."""
TILES = 24
"""Patches at most."""


@dataclass(frozen=True)
class Row:
    """tolerance: asked for, None for the reference, which has none. error: worst patch and window,
    with its 99.9 % interval. run_time_s: of the camera for the whole run, from ns_per_pixel_cycle.
    effects: kept by some tile. left_out: by some tile. same_as: the tighter tolerance that gives
    the same plan, and so the same figures."""

    tier: str
    tolerance: float | None
    error: float | None
    ci: tuple[float, float] | None
    run_time_s: float
    ns_per_pixel_cycle: float
    effects: list[str]
    left_out: list[str]
    same_as: float | None = None

    def document(self) -> dict[str, Any]:
        return {
            "tier": self.tier, "tolerance": self.tolerance, "error": self.error, "ci": self.ci,
            "run_time_s": self.run_time_s, "ns_per_pixel_cycle": self.ns_per_pixel_cycle,
            "effects": self.effects, "left_out": self.left_out, "same_as": self.same_as,
        }  # fmt: skip


def fit_rows(rows: Sequence[Row]) -> float | None:
    """Over the rows that leave something to the tolerance, those that only repeat one aside."""
    floor = min((r.error for r in rows if r.error and not r.tolerance), default=0.0)
    points = [(r.tolerance or 0.0, r.error or 0.0) for r in rows if r.same_as is None]
    return fit_order(points, floor)


def _signature(plan: RunPlan) -> tuple[bytes, ...]:
    return tuple(tiles.tobytes() for tiles in plan.plan.kept.values())


def _ladder(
    seen: Any,
    setting: Any,
    instants: list[int],
    device: Device | None,
    tier: Tier,
    display: DisplaySetting | None,
) -> list[tuple[list[float], RunPlan]]:
    """Distinct plans of one tier, each with the tolerances that give it, the tightest first."""
    found: list[tuple[list[float], RunPlan]] = []
    for tolerance in LADDER:
        plan = plan_run(seen, setting, tolerance, instants, device, tier=tier, display=display)
        if found and _signature(plan) == _signature(found[-1][1]):
            found[-1][0].append(tolerance)
        else:
            found.append(([tolerance], plan))
    return found


def _alike(
    ladder: Sequence[tuple[Tier, list[float], RunPlan]], spent: list[float], others: set[str]
) -> list[float]:
    """Cameras that differ in nothing but these other effects take the same: the least of them."""
    keys = [
        (tier, *(k.tobytes() for name, k in plan.plan.kept.items() if name not in others))
        for tier, _, plan in ladder
    ]
    return [min(s for k, s in zip(keys, spent, strict=True) if k == key) for key in keys]


def _tiles(plans: Sequence[RunPlan], seed: int) -> list[int]:
    """Patches that any of the plans would check, at most TILES."""
    order: dict[int, None] = {}
    each = [plan.patches(seed) for plan in plans]
    for n in range(max(len(e) for e in each)):
        order |= dict.fromkeys(e[n] for e in each if n < len(e))
    return sorted(list(order)[:TILES])


def accuracy(scenario: Scenario, device_name: str | None, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --json` for a synchronous camera."""
    setting, cycles, instants, lens, white, device = prepare_camera(scenario, device_name)
    progress.note("looking at the scene")
    seen = look_at(scenario, setting, lens, cycles)
    display = look_through(scenario, setting, white, instants, cycles)[0]
    tiers: list[Tier] = ["exact"]
    if device is not None:
        tiers.append("fast")
    ladder = [
        (tier, tolerances, plan)
        for tier in tiers
        for tolerances, plan in _ladder(seen, setting, instants, device, tier, display)
    ]
    plane = PatchPlane(seen.grid, _tiles([plan for *_, plan in ladder], scenario.seed))
    cameras = {"reference": PatchCamera(setting, plane, "reference")}
    names = [f"{tier} {tolerances[0]:g}" for tier, tolerances, _ in ladder]
    for name, (tier, _, plan) in zip(names, ladder, strict=True):
        planned = Planned(tier, plan.setting, plan.flags)
        cameras[name] = planned.on(plane, seen.grid, device)
    window, floor = scenario.image.window, seen.scene.floor
    shown = None
    if display is not None:
        displays = {TRUTH: ("reference", display)}
        displays |= {
            name: (name, plan.display)
            for name, (*_, plan) in zip(names, ladder, strict=True) if plan.display is not None
        }  # fmt: skip
        shown = ShownPatches(plane, displays, floor)
    paired = ShownPaired(plane, cameras, windows(instants, window, cycles), shown)
    spent, words = _film(scenario, setting, lens, cycles, paired, ladder, device, progress)
    pixels = setting.chip.height * setting.chip.width
    golden = 0.0
    if display is not None and scenario.display is not None:
        golden = golden_ns(display, words)
        spent = _alike(ladder, spent, {effect.name for effect in display.kept})
        settings = dict.fromkeys(p.display for *_, p in ladder if p.display is not None)
        costs = {s: display_ns(scenario.display.renderer, s, words) for s in settings}
        spent = [
            ns + costs[plan.display] if plan.display is not None else ns
            for ns, (*_, plan) in zip(spent, ladder, strict=True)
        ]
    truth = paired.rates("reference")
    rows = []
    for name, (tier, tolerances, plan), ns in zip(names, ladder, spent, strict=True):
        found = worst(paired.rates(name), truth, floor) if shown is None else shown.error(name)
        for at, tolerance in enumerate(tolerances):
            rows.append(Row(
                tier, tolerance, found.value, (found.low, found.high),
                ns * 1e-9 * pixels * cycles, ns, list(plan.plan.everywhere),
                list(plan.plan.left_out), tolerances[0] if at else None,
            ))  # fmt: skip
    ns = paired.ns("reference") + golden
    own = reference_error(setting, plane.numbers[:DRAWS])
    everything = [effect.name for effect in setting.kept]
    if display is not None:
        everything += [effect.name for effect in display.kept]
    seconds = ns * 1e-9 * pixels * cycles
    best = Row("reference", None, own, (0.0, own), seconds, ns, everything, [])
    n = float(np.mean(truth)) * window * plane.numbers.size / len(plane.tiles)
    return {
        "scenario": scenario.title,
        "error_of": "rate" if display is None else "radiance",
        "device": device.name if device is not None else "numba on this processor",
        "reference": {
            "tier": "reference", "error": own, "ns_per_pixel_cycle": ns,
            "run_time_s": best.run_time_s, "effects": everything,
            "patches": len(plane.tiles), "pixels": int(plane.numbers.size),
        },
        "order": fit_rows(rows),
        "floor": {
            "reference": own, "monte_carlo": setting.spread / math.sqrt(n) if n > 0 else None,
        },
        "rows": [row.document() for row in [*rows, best]],
    }  # fmt: skip


def reference_error(setting: CameraSetting, numbers: npt.NDArray[np.uint32]) -> float:
    """Of the reference itself, relative: its thresholds of these pixels' first spikes against the
    law inverted for them. Its time is closed form, right to roundings."""
    from cosim.compute.philox import philox4x32
    from sensor.latched.effects import SHOT_NOISE
    from sensor.latched.reference.law import law_error, law_of

    shot = SHOT_NOISE in setting.effects
    words = philox4x32((numbers, 0, 0, 0), (setting.seed, SHOT_NOISE.stream))[0]
    return law_error(law_of(setting.threshold, setting.threshold_noise, shot), words)


def _film(
    scenario: Scenario, setting: Any, lens: Any, cycles: int, paired: Paired,
    ladder: Sequence[tuple[Tier, list[float], RunPlan]], device: Device | None, progress: Progress,
) -> tuple[list[float], list[tuple[Block, Words]]]:  # fmt: skip
    """Runs the scene once; ns a pixel-cycle of every row, and the words of the timed blocks."""
    wider = WiderStage(scene_source(scenario, setting, cycles), setting.reach)
    relay = lens.relay(setting.chip.pitch)
    size = BLOCK
    blocks = -(-cycles // size)
    first = max(min(blocks // 2 - 1, blocks - TIMED - 1), 0) if blocks > TIMED else 0
    timed = range(first, min(first + TIMED + 1, blocks))
    pixels = setting.chip.height * setting.chip.width
    each: list[list[float]] = [[] for _ in ladder]
    whole: list[SpikeCamera] = []
    words: list[tuple[Block, Words]] = []
    progress.start(f"{len(ladder)} rows of {cycles} cycles", cycles)
    for n in range(blocks):
        block = Block(n * size, min(size, cycles - n * size))
        light = relay(wider.step(None, block))
        paired.step(light, block)
        if n in timed:
            if not whole:
                whole = [
                    SpikeCamera(plan.setting, device, tier=tier, flags=plan.flags)
                    for tier, _, plan in ladder
                ]
            again = 2 if len(timed) == 1 else 1  # the only block: its first call warms up
            for camera, took in [*zip(whole, each, strict=True)] * again:
                begin = time.perf_counter()
                latched = camera.step(light, block).words
                took.append((time.perf_counter() - begin) * 1e9 / (pixels * block.cycles))
                if camera is whole[0]:
                    words.append((block, latched))
        elif n > timed[-1]:
            whole = []
        progress.advance(block.stop)
    return [min(took[1:] or took) for took in each], words
