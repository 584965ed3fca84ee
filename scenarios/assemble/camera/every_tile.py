"""The error of every tile of a chip, against the error that a run states.

A run measures its error on a few tiles. Here the reference and the planned cameras expose every
tile of full size to the same light, with the same random counters. For each tolerance the errors of
all tiles are compared with the limit that the run states and with the tolerance. This takes as long
as full physics on the whole chip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from cosim import BLOCK, Block
from cosim.plan.paired import Measured, TrialCamera, Values, compare
from cosim.plan.patches import PatchPlane
from cosim.run.machine import BrokenPromise
from cosim.run.progress import Progress
from display.trial.paired import TRUTH, DisplayPatches, DisplayTrial
from scenarios.assemble.camera.planning import RunPlan
from scenarios.assemble.camera.setup import CameraSetup
from scenarios.assemble.camera.verifier import Verifier
from sensor.latched.check.samples import sample_tiles
from sensor.latched.fine_tiles import PatchCamera

TOLERANCES: Final = (0.0, 1e-3, 1e-2, 0.1)
"""Tolerances at which the errors are measured."""
REFERENCE: Final = "reference"


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


def _expose(setup: CameraSetup, trial: DisplayTrial, what: str, progress: Progress) -> None:
    """Exposes the patches of a trial to the scene."""
    scene, lens = setup.stages(setup.source()).values()
    progress.start(what, setup.cycles)
    for start in range(0, setup.cycles, BLOCK):
        block = Block(start, min(BLOCK, setup.cycles - start))
        trial.step(lens.step(scene.step(None, block), block), block)
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
        verifier = Verifier(plan, setup.setting, tiles, setup.device, samples)
        try:
            _expose(setup, verifier, f"check at tolerance {tolerance:g}", progress)
            findings = verifier.shortfall(plan.tier)
        except BrokenPromise as exc:
            findings = exc.findings
        if not findings:
            outcome = "degraded" if verifier.beyond() else "ok"
            return _Stated(plan, verifier.error(), outcome, reinstated)
        reinstated += [finding.effect for finding in findings]


def _trial(setup: CameraSetup, stated: dict[str, _Stated]) -> DisplayTrial:
    """The reference and the cameras of all plans on every tile of full size."""
    survey, display = setup.survey, setup.display
    plane = PatchPlane(survey.grid, np.flatnonzero(survey.grid.whole).tolist())
    cameras: dict[str, TrialCamera] = {REFERENCE: PatchCamera(setup.setting, plane, REFERENCE)}
    cameras |= {name: each.plan.on_patches(plane, setup.device) for name, each in stated.items()}
    patches = None
    if display is not None:
        shown = {TRUTH: (REFERENCE, display)}
        for name, each in stated.items():
            assert each.plan.display is not None
            shown[name] = name, each.plan.display
        patches = DisplayPatches(plane, shown, survey.scene.floor)
    spans = setup.spans
    return DisplayTrial(plane, cameras, spans, patches)


def _errors(trial: DisplayTrial, name: str, floor: float) -> Values:
    """Relative RMS error of each tile in its worst window or image, (tiles,)."""
    if trial.displays is not None:
        error = trial.displays.errors(name)
    else:
        error = compare(trial.rates(name), trial.rates(REFERENCE), floor)[0]
    return np.asarray(error.max(axis=0))


def every_tile(setup: CameraSetup, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --every-tile --json`.

    A row `holds` if the error of no tile is above the stated limit, and if the outcome is not "ok"
    with a tile above the tolerance (at tolerance 0: above the limit only).
    """
    progress.note("surveying the scene")
    stated = {f"{tolerance:g}": _stated(setup, tolerance, progress) for tolerance in TOLERANCES}
    trial = _trial(setup, stated)
    tiles = len(trial.plane.tiles)
    _expose(setup, trial, f"{len(stated)} plans on {tiles} tiles", progress)
    rows = []
    for tolerance, (name, each) in zip(TOLERANCES, stated.items(), strict=True):
        errors = _errors(trial, name, setup.survey.scene.floor)
        worst = int(np.argmax(errors))
        over_limit = int((errors > each.error.high).sum())
        over_tolerance = int((errors > tolerance).sum()) if tolerance > 0 else None
        rows.append({
            "tier": each.plan.tier, "tolerance": tolerance, "error": each.error.value,
            "ci": (each.error.low, each.error.high), "outcome": each.outcome,
            "reinstated": each.reinstated, "tiles": tiles,
            "full_physics_tiles": each.plan.full_physics, "over_limit": over_limit,
            "over_tolerance": over_tolerance, "worst_tile": trial.plane.tiles[worst],
            "worst_error": float(errors[worst]),
            "holds": not over_limit and (each.outcome != "ok" or not over_tolerance),
        })  # fmt: skip
    return {
        "scenario": setup.scenario.title,
        "error_of": "rate" if setup.display is None else "radiance",
        "device": setup.device_name,
        "rows": rows,
    }
