"""The planned camera of a run, and the stage that checks it."""

from __future__ import annotations

from scenarios.assemble.source.latched.bands import BandedCamera, Bands
from scenarios.assemble.source.latched.boards import BoardCamera, Boards
from scenarios.assemble.source.latched.dim import reading_camera
from scenarios.assemble.source.latched.plan import CameraCheck, RunPlan
from scenarios.assemble.source.latched.setup import CameraSetup
from sensor import SpikeCamera
from sensor.latched.check.samples import sample_tiles
from sensor.latched.reading import ReadingCamera

PlannedCamera = SpikeCamera | ReadingCamera | BoardCamera | BandedCamera
"""The simulated camera, or in its place a board, or bands that workers simulate."""


def planned_camera(
    plan: RunPlan, setup: CameraSetup, boards: Boards, bands: Bands | None
) -> tuple[PlannedCamera, CameraCheck | None]:
    """The planned camera and the stage that checks it."""
    board = boards.camera(setup.setting, plan.survey.scene, setup.cycles)
    if board is not None:
        return board, None
    camera: SpikeCamera | ReadingCamera | BandedCamera
    if bands is None or plan.fine.all():  # where all tiles are fine, nothing is left to workers
        camera = reading_camera(plan.camera(setup.device), setup.scenario.sensor, setup.setting)
    else:
        camera = BandedCamera(setup, plan, bands)
    tiles = plan.patches(setup.scenario.seed)
    samples = None
    if plan.display is None:  # a display is checked by radiance, which needs whole tiles
        samples = sample_tiles(plan, tiles, setup.device, setup.scenario.seed)
    keep = setup.scenario.link is not None  # its code changes the spikes that the display shows
    return camera, CameraCheck(plan, setup.setting, tiles, setup.device, samples, keep)
