"""Error against run time of a latched camera: every tier at a ladder of tolerances.

The error of a row is the error of its plan against the reference on patches, over the image windows
of the scenario, with common random numbers. Where a plan takes thresholds from the bank, it is one
in law (`of`): the patches have the draws of the reference, and the distance of the law of the bank
is added. The run time of a row is that of the camera alone: the minimum over consecutive blocks of
the whole chip, in the middle of the run, after one block for warm-up. All rows share the same
light, which is computed once. The evaluation of errors is not timed.

If the scenario has a display, the error is that of the radiance that its observer integrates,
against the reference camera on the golden display; the run time of a row is that of the camera and
of the renderer on the same blocks. The display of the reference is the golden model.

With `--every-tile`, the reference and the planned cameras expose every tile of full size instead,
for a few tolerances, and the errors of all tiles are compared with the limit that a run states from
its few patches, and with the tolerance. This takes as long as full physics on the whole chip.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from cosim import BLOCK, Block
from cosim.plan.error import BrokenPromise, Measured
from cosim.plan.paired import CheckCamera, Paired, Values, compare, worst
from cosim.plan.planner import Plan
from cosim.plan.study import REFERENCE, Rung, Step, climb, ladder_document
from cosim.plan.tiles import PatchPlane
from cosim.run.progress import Progress
from cosim.spikes.viform import Words
from display.plan.cost import display_ns, golden_ns
from display.plan.paired import TRUTH, DisplayCheck, DisplayPatches
from scenarios.assemble.source.latched.plan import CameraCheck, RunPlan
from scenarios.assemble.source.latched.setup import CameraSetup
from sensor import SpikeCamera
from sensor.latched.check.samples import sample_tiles
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.levels import fast_can_follow
from sensor.latched.reference.law import DRAWS, reference_error

TIMED = 3
"""Number of blocks of the whole chip that are timed, after one block for warm-up."""
TILES = 24
"""Maximum number of patches."""
STATED: Final = (0.0, 1e-3, 1e-2, 0.1)
"""Tolerances at which the errors of every tile are measured."""


_Rung = Rung[RunPlan]


def _signature(plan: RunPlan) -> tuple[bytes, ...]:
    return tuple(tiles.tobytes() for tiles in plan.plan.kept.values())


def _ladder(setup: CameraSetup) -> list[_Rung]:
    follows = fast_can_follow(setup.setting, setup.survey.scene)
    return climb(
        ["exact", "fast"] if setup.device is not None and follows else ["exact"],
        lambda tier, tolerance: setup.plan(tolerance, tier=tier, mixed=False), _signature,
    )  # fmt: skip


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


def _paired(setup: CameraSetup, rungs: Sequence[_Rung]) -> DisplayCheck:
    """The check of the reference and of every rung on the same patches."""
    survey, setting, display = setup.survey, setup.setting, setup.display
    plane = PatchPlane(survey.grid, _tiles([r.plan for r in rungs], setup.scenario.seed))
    cameras: dict[str, CheckCamera] = {REFERENCE: PatchCamera(setting, plane, REFERENCE)}
    for rung in rungs:
        cameras[rung.name] = rung.plan.on_patches(plane, setup.device)
    patches = None
    if display is not None:
        displays = {TRUTH: (REFERENCE, display)}
        displays |= {
            rung.name: (rung.name, rung.plan.display)
            for rung in rungs if rung.plan.display is not None
        }  # fmt: skip
        patches = DisplayPatches(plane, displays, survey.scene.floor)
    spans = setup.spans
    return DisplayCheck(plane, cameras, spans, patches)


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
    truth = paired.rates(REFERENCE)
    steps: list[Step] = []
    for rung, ns in zip(rungs, spent, strict=True):
        error = (
            worst(paired.rates(rung.name), truth, floor) if paired.displays is None
            else paired.displays.error(rung.name)
        )  # fmt: skip
        plan = rung.plan.plan
        apart = rung.plan.bank_bound[paired.plane.tiles]
        steps += rung.steps(
            error.in_law(float(apart.max())), ns, pixels * cycles, _effects(plan, own),
            plan.left_out, rung.plan.of,
        )  # fmt: skip
    ns, plane = paired.ns(REFERENCE) + golden, paired.plane
    own_error = reference_error(setting, plane.numbers[:DRAWS])
    everything = [effect.name for effect in setting.acting_effects] + own
    if display is not None:
        everything += [effect.name for effect in display.acting_effects]
    best = Step.measured(
        REFERENCE, None, Measured(own_error, 0.0, own_error), ns, pixels * cycles, everything
    )
    n = float(np.mean(truth)) * scenario.image.window * plane.numbers.size / len(plane.tiles)
    return ladder_document(
        [*steps, best],
        {
            "tier": REFERENCE, "error": own_error, "ns_per_pixel_cycle": ns,
            "run_time_s": best.run_time_s, "effects": everything,
            "patches": len(plane.tiles), "pixels": int(plane.numbers.size),
        },
        own_error, setting.spread / math.sqrt(n) if n > 0 else None,
        **_about(setup),
    )  # fmt: skip


def _about(setup: CameraSetup) -> dict[str, Any]:
    """Keys that both documents begin with."""
    return {
        "scenario": setup.scenario.title,
        "error_of": "rate" if setup.display is None else "radiance",
        "device": setup.device_name,
    }


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


@dataclass(frozen=True, eq=False)
class _Stated:
    """The plan of a run after its check, and the error that the run states.

    Attributes:
        plan: the plan that the check accepts.
        error: measured on the patches of the run.
        outcome: "ok" or "degraded", as the run has it because of its error.
        reinstated: effects that the check has reinstated.
    """

    plan: RunPlan
    error: Measured
    outcome: str
    reinstated: list[str]


def _expose(setup: CameraSetup, check: DisplayCheck, what: str, progress: Progress) -> None:
    """Exposes the patches of a check to the scene."""
    scene, lens = setup.stages(setup.source()).values()
    progress.start(what, setup.cycles)
    for start in range(0, setup.cycles, BLOCK):
        block = Block(start, min(BLOCK, setup.cycles - start))
        check.step(lens.step(scene.step(None, block), block), block)
        progress.advance(block.stop)


def _stated(setup: CameraSetup, tolerance: float, progress: Progress) -> _Stated:
    """Plans and checks a run as `viform run` does, on its patches only."""
    reinstated: list[str] = []
    while True:
        plan = setup.plan_keeping(tolerance, reinstated)
        tiles = plan.patches(setup.scenario.seed)
        samples = (
            None if setup.display else sample_tiles(plan, tiles, setup.device, setup.scenario.seed)
        )
        check = CameraCheck(plan, setup.setting, tiles, setup.device, samples)
        try:
            _expose(setup, check, f"check at tolerance {tolerance:g}", progress)
            findings = check.shortfall(plan.tier)
        except BrokenPromise as exc:
            findings = exc.findings
        if not findings:
            outcome = "degraded" if check.beyond() else "ok"
            return _Stated(plan, check.error(), outcome, reinstated)
        reinstated += [finding.effect for finding in findings]


def _every_check(setup: CameraSetup, stated: dict[str, _Stated]) -> DisplayCheck:
    """The reference and the cameras of all plans on every tile of full size."""
    survey, display = setup.survey, setup.display
    plane = PatchPlane(survey.grid, np.flatnonzero(survey.grid.whole).tolist())
    cameras: dict[str, CheckCamera] = {REFERENCE: PatchCamera(setup.setting, plane, REFERENCE)}
    cameras |= {name: each.plan.on_patches(plane, setup.device) for name, each in stated.items()}
    patches = None
    if display is not None:
        shown = {TRUTH: (REFERENCE, display)}
        for name, each in stated.items():
            assert each.plan.display is not None
            shown[name] = name, each.plan.display
        patches = DisplayPatches(plane, shown, survey.scene.floor)
    spans = setup.spans
    return DisplayCheck(plane, cameras, spans, patches)


def _errors(check: DisplayCheck, name: str, floor: float) -> Values:
    """Relative RMS error of each tile in its worst window or image, (tiles,)."""
    if check.displays is not None:
        error = check.displays.errors(name)
    else:
        error = compare(check.rates(name), check.rates(REFERENCE), floor)[0]
    return np.asarray(error.max(axis=0))


def every_tile(setup: CameraSetup, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --every-tile --json`.

    A row `holds` if the error of no tile is above the stated limit, and if the outcome is not "ok"
    with a tile above the tolerance (at tolerance 0: above the limit only).
    """
    progress.note("surveying the scene")
    stated = {f"{tolerance:g}": _stated(setup, tolerance, progress) for tolerance in STATED}
    check = _every_check(setup, stated)
    tiles = len(check.plane.tiles)
    _expose(setup, check, f"{len(stated)} plans on {tiles} tiles", progress)
    rows = []
    for tolerance, (name, each) in zip(STATED, stated.items(), strict=True):
        errors = _errors(check, name, setup.survey.scene.floor)
        errors = errors + each.plan.bank_bound[check.plane.tiles]
        worst = int(np.argmax(errors))
        over_limit = int((errors > each.error.high).sum())
        over_tolerance = int((errors > tolerance).sum()) if tolerance > 0 else None
        rows.append({
            "tier": each.plan.tier, "tolerance": tolerance, "error": each.error.value,
            "ci": (each.error.low, each.error.high), "of": each.plan.of, "outcome": each.outcome,
            "reinstated": each.reinstated, "tiles": tiles,
            "full_physics_tiles": each.plan.full_physics, "over_limit": over_limit,
            "over_tolerance": over_tolerance, "worst_tile": check.plane.tiles[worst],
            "worst_error": float(errors[worst]),
            "holds": not over_limit and (each.outcome != "ok" or not over_tolerance),
        })  # fmt: skip
    return {**_about(setup), "rows": rows}
