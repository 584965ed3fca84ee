"""A latched camera that is planned and measured without a run: its plan and predicted run time, and
the ladder of its errors (`ladder`)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from cosim import BLOCK, Block
from cosim.plan.study import Speeds, film_blocks, forecast_document
from cosim.plan.tiles import PatchPlane
from cosim.run.progress import Progress
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.boards import refuse_boards
from scenarios.assemble.source.latched.ladder import accuracy, every_tile
from scenarios.assemble.source.latched.memory import check_run_memory, peak_memory
from scenarios.assemble.source.latched.plan import RunPlan
from scenarios.assemble.source.latched.setup import CameraSetup, set_up_camera
from sensor.latched.bounds import law_of_plan
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fine_tiles import PatchCamera

BLOCKS = 4
"""Number of blocks that are run, from the start of the scene. The first compiles; of the others the
least time counts, as other programs can only add to it."""
REFERENCE_TILES = 12
"""Number of tiles on which the reference is timed."""


def _with_every_effect(setup: CameraSetup, plan: RunPlan) -> RunPlan | None:
    """The plan with every effect of the camera, in the same tier; None if `plan` is that."""
    tolerance, names = setup.scenario.tolerance, [e.name for e in setup.setting.acting_effects]
    names += [name for name in (OWN_DRAWS,) if name in plan.plan.kept]
    everything = setup.plan(tolerance, tier=plan.tier, forced=names)
    kept = (run.plan.kept for run in (plan, everything))
    mine, theirs = (
        [np.broadcast_to(k[n], plan.fine.shape)[~plan.fine] for n in names] for k in kept
    )
    return None if np.array_equal(mine, theirs) else everything


def _measure(setup: CameraSetup, plan: RunPlan, everything: RunPlan | None) -> Speeds:
    grid, cycles = plan.survey.grid, setup.cycles
    size = min(BLOCK, max(cycles // BLOCKS, 1))
    scene, lens = setup.stages(setup.source()).values()
    whole = np.flatnonzero(grid.whole)
    plane = PatchPlane(grid, whole[:: max(len(whole) // REFERENCE_TILES, 1)].tolist())
    return film_blocks(
        [Block(n * size, size) for n in range(BLOCKS)], grid.height * grid.width,
        lambda block: lens.step(scene.step(None, block), block),
        [run.camera(setup.device).step for run in (plan, everything) if run is not None],
        (plane, PatchCamera(setup.setting, plane, "reference")),
    ).speeds  # fmt: skip


def _display(setup: CameraSetup, plan: RunPlan) -> dict[str, Any] | None:
    """Description of the planned display; None without one."""
    if plan.display is None or setup.scenario.display is None:
        return None
    return {
        "drive": plan.display.panel.drive, "observer": setup.scenario.display.observer,
        "planes_to_a_span": plan.display.batch,
    }  # fmt: skip


def _writes(setup: CameraSetup, plan: RunPlan) -> dict[str, Any]:
    """The register writes of the run and what the plan says of them; {} without any."""
    if not setup.setting.writes:
        return {}
    return {"writes": [asdict(phase) for phase in setup.setting.phases], "notes": plan.notes}


def forecast(name: str, setup: CameraSetup) -> dict[str, Any]:
    """The document of `viform plan --json`."""
    plan = setup.plan(setup.scenario.tolerance)
    planes = plan.survey.light.planes
    check_run_memory(setup, planes)
    document = forecast_document(
        name, plan.plan, tier=plan.tier, device=setup.device_name, tier_error=plan.tier_error,
        speeds=_measure(setup, plan, _with_every_effect(setup, plan)),
        pixel_cycles=setup.setting.chip.width * setup.setting.chip.height * setup.cycles,
        tiles=setup.survey.classes, full_physics_tiles=plan.full_physics,
        exact_tiles=int(plan.exact.sum()), display=_display(setup, plan), law=law_of_plan(plan),
        **_writes(setup, plan),
    )  # fmt: skip
    document["predicted"]["memory_bytes"] = peak_memory(setup, planes)
    return document


class LatchedStudy:
    """Implements `Study`. Raises InputError for a camera that cannot be simulated."""

    def __init__(self, name: str, scenario: Scenario, device: str | None) -> None:
        refuse_boards(scenario)
        self._name, self._setup = name, set_up_camera(scenario, device)
        check_run_memory(self._setup)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast(self._name, self._setup)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return accuracy(self._setup, progress)

    def every_tile(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform accuracy --every-tile`."""
        return every_tile(self._setup, progress)
