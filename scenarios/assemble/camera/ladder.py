"""Error against run time of a latched camera: every tier at a ladder of tolerances.

The error of a row is the error of its plan against the reference on patches, over the image windows
of the scenario, with common random numbers. The run time of a row is that of the camera alone: the
minimum over consecutive blocks of the whole chip, in the middle of the run, after one block for
warm-up. All rows share the same light, which is computed once. The evaluation of errors is not
timed.

If the scenario has a display, the error is that of the radiance that its observer integrates,
against the reference camera on the golden display; the run time of a row is that of the camera and
of the renderer on the same blocks. The display of the reference is the golden model.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import BLOCK, Block
from cosim.plan.ladder import Row, distinct_plans, fit_rows
from cosim.plan.paired import Paired, TrialCamera, worst
from cosim.plan.patches import PatchPlane
from cosim.plan.planner import Plan
from cosim.run.progress import Progress
from cosim.spikes.viform import Words
from display.trial.cost import display_ns, golden_ns
from display.trial.paired import TRUTH, DisplayPatches, DisplayTrial
from scenarios.assemble.camera.planning import RunPlan
from scenarios.assemble.camera.setup import CameraSetup
from sensor import SpikeCamera
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.levels import fast_can_follow
from sensor.latched.reference.law import DRAWS, reference_error
from sensor.latched.tiers import Tier

TIMED = 3
"""Number of blocks of the whole chip that are timed, after one block for warm-up."""
TILES = 24
"""Maximum number of patches."""


@dataclass(frozen=True)
class _Rung:
    """A plan of the ladder.

    Attributes:
        tier: tier of the camera.
        tolerances: tolerances that lead to this plan.
        plan: the plan.
    """

    tier: Tier
    tolerances: list[float]
    plan: RunPlan

    @property
    def name(self) -> str:
        return f"{self.tier} {self.tolerances[0]:g}"


def _signature(plan: RunPlan) -> tuple[bytes, ...]:
    return tuple(tiles.tobytes() for tiles in plan.plan.kept.values())


def _ladder(setup: CameraSetup) -> list[_Rung]:
    follows = fast_can_follow(setup.setting, setup.survey.scene)
    tiers: list[Tier] = ["exact", "fast"] if setup.device is not None and follows else ["exact"]
    return [
        _Rung(tier, tolerances, plan)
        for tier in tiers
        for tolerances, plan in distinct_plans(
            lambda tolerance, tier=tier: setup.plan(tolerance, tier=tier, mixed=False),  # type: ignore[misc]
            _signature,
        )
    ]


def _least_of_equals(rungs: Sequence[_Rung], spent: list[float], others: set[str]) -> list[float]:
    """The least time of all rungs with the same camera, for each rung: plans that differ only in
    the effects `others` have the same camera."""
    keys = [
        (rung.tier, *(k.tobytes() for name, k in rung.plan.plan.kept.items() if name not in others))
        for rung in rungs
    ]
    return [min(s for k, s in zip(keys, spent, strict=True) if k == key) for key in keys]


def _effects(plan: Plan, own: list[str]) -> list[str]:
    """Effects that a plan keeps, including draws of their own in a tier that has no others."""
    return [*plan.everywhere, *(name for name in own if name not in plan.kept)]


def _tiles(plans: Sequence[RunPlan], seed: int) -> list[int]:
    """Numbers of the tiles that any of the plans would check, at most TILES."""
    order: dict[int, None] = {}
    lists = [plan.patches(seed) for plan in plans]
    for n in range(max(len(tiles) for tiles in lists)):
        order |= dict.fromkeys(tiles[n] for tiles in lists if n < len(tiles))
    return sorted(list(order)[:TILES])


def _paired(setup: CameraSetup, rungs: Sequence[_Rung]) -> DisplayTrial:
    """The trial of the reference and of every rung on the same patches."""
    survey, setting, display = setup.survey, setup.setting, setup.display
    plane = PatchPlane(survey.grid, _tiles([r.plan for r in rungs], setup.scenario.seed))
    cameras: dict[str, TrialCamera] = {"reference": PatchCamera(setting, plane, "reference")}
    for rung in rungs:
        cameras[rung.name] = rung.plan.on_patches(plane, setup.device)
    patches = None
    if display is not None:
        displays = {TRUTH: ("reference", display)}
        displays |= {
            rung.name: (rung.name, rung.plan.display)
            for rung in rungs if rung.plan.display is not None
        }  # fmt: skip
        patches = DisplayPatches(plane, displays, survey.scene.floor)
    spans = setup.spans
    return DisplayTrial(plane, cameras, spans, patches)


def accuracy(setup: CameraSetup, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --json` for a latched camera."""
    scenario, setting, cycles = setup.scenario, setup.setting, setup.cycles
    progress.note("surveying the scene")
    display, rungs = setup.display, _ladder(setup)
    paired, floor = _paired(setup, rungs), setup.survey.scene.floor
    own = [OWN_DRAWS] if any(OWN_DRAWS in rung.plan.plan.kept for rung in rungs) else []
    spent, words = _film(setup, paired, rungs, progress)
    pixels = setting.chip.height * setting.chip.width
    golden = 0.0
    if display is not None and scenario.display is not None:
        golden = golden_ns(display, words)
        spent = _least_of_equals(rungs, spent, {effect.name for effect in display.acting_effects})
        settings = dict.fromkeys(r.plan.display for r in rungs if r.plan.display is not None)
        costs = {s: display_ns(scenario.display.renderer, s, words) for s in settings}
        spent = [
            ns + costs[rung.plan.display] if rung.plan.display is not None else ns
            for ns, rung in zip(spent, rungs, strict=True)
        ]
    truth = paired.rates("reference")
    rows = []
    for rung, ns in zip(rungs, spent, strict=True):
        error = (
            worst(paired.rates(rung.name), truth, floor) if paired.displays is None
            else paired.displays.error(rung.name)
        )  # fmt: skip
        for at, tolerance in enumerate(rung.tolerances):
            rows.append(Row(
                rung.tier, tolerance, error.value, (error.low, error.high),
                ns * 1e-9 * pixels * cycles, ns, _effects(rung.plan.plan, own),
                list(rung.plan.plan.left_out), rung.tolerances[0] if at else None,
            ))  # fmt: skip
    ns = paired.ns("reference") + golden
    plane = paired.plane
    floor_error = reference_error(setting, plane.numbers[:DRAWS])
    everything = [effect.name for effect in setting.acting_effects] + own
    if display is not None:
        everything += [effect.name for effect in display.acting_effects]
    seconds = ns * 1e-9 * pixels * cycles
    best = Row("reference", None, floor_error, (0.0, floor_error), seconds, ns, everything, [])
    n = float(np.mean(truth)) * scenario.image.window * plane.numbers.size / len(plane.tiles)
    return {
        "scenario": scenario.title,
        "error_of": "rate" if display is None else "radiance",
        "device": setup.device_name,
        "reference": {
            "tier": "reference", "error": floor_error, "ns_per_pixel_cycle": ns,
            "run_time_s": best.run_time_s, "effects": everything,
            "patches": len(plane.tiles), "pixels": int(plane.numbers.size),
        },
        "order": fit_rows(rows),
        "floor": {
            "reference": floor_error,
            "monte_carlo": setting.spread / math.sqrt(n) if n > 0 else None,
        },
        "rows": [row.document() for row in [*rows, best]],
    }  # fmt: skip


def _film(
    setup: CameraSetup, paired: Paired, rungs: Sequence[_Rung], progress: Progress
) -> tuple[list[float], list[tuple[Block, Words]]]:
    """Runs the scene once.

    Returns:
        The time of every rung, ns a pixel-cycle, and the timed blocks with their words.
    """
    scene, lens = setup.stages(setup.source()).values()
    cycles = setup.cycles
    blocks = -(-cycles // BLOCK)
    first = max(min(blocks // 2 - 1, blocks - TIMED - 1), 0) if blocks > TIMED else 0
    timed = range(first, min(first + TIMED + 1, blocks))
    pixels = setup.setting.chip.height * setup.setting.chip.width
    each: list[list[float]] = [[] for _ in rungs]
    cameras: list[SpikeCamera] = []
    words: list[tuple[Block, Words]] = []
    progress.start(f"{len(rungs)} rows of {cycles} cycles", cycles)
    for n in range(blocks):
        block = Block(n * BLOCK, min(BLOCK, cycles - n * BLOCK))
        light = lens.step(scene.step(None, block), block)
        paired.step(light, block)
        if n in timed:
            if not cameras:
                cameras = [rung.plan.camera(setup.device) for rung in rungs]
            again = 2 if len(timed) == 1 else 1  # the only block: its first call warms up
            for camera, took in [*zip(cameras, each, strict=True)] * again:
                begin = time.perf_counter()
                latched = camera.step(light, block).words
                took.append((time.perf_counter() - begin) * 1e9 / (pixels * block.cycles))
                if camera is cameras[0]:
                    words.append((block, latched))
        elif n > timed[-1]:
            cameras = []
        progress.advance(block.stop)
    return [min(took[1:] or took) for took in each], words
