"""The camera of a scenario in memory; which scenarios a camera or a display in memory can do,
without a run."""

from __future__ import annotations

from cosim.compute.opencl import Device
from cosim.run.inputs import FILE
from scenarios.assemble.schema.scenario import AnyScenario, RecordingScenario, Scenario
from scenarios.scenes.kinds.film import FilmScene
from sensor.latched.core import LatchedCamera
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier

__all__ = ["called_camera", "in_memory", "shown_in_memory"]


def called_camera(
    scenario: Scenario, setting: CameraSetting, device: Device | None, tier: Tier | None = None
) -> LatchedCamera:
    """The camera of a scenario, to be called. setting: of it; device, tier: see `LatchedCamera`."""
    return LatchedCamera(
        setting, device, tolerance=scenario.tolerance, window=scenario.image.window,
        floor=scenario.image.floor, tier=tier, duplicated_rows=scenario.sensor.duplicated_rows,
    )  # fmt: skip


def in_memory(scenario: AnyScenario) -> Scenario | None:
    """The scenario, if all it asks for is a simulated camera before frames that are given to it;
    else None."""
    if not isinstance(scenario, Scenario):
        return None
    sensor, scene = scenario.sensor, scenario.scene
    parts = (
        scenario.display, scenario.link, scenario.code, scenario.camera, scenario.readout,
        sensor.source, sensor.sub_threshold,
    )  # fmt: skip
    plain = scene == FilmScene.model_construct(illuminance=scene.illuminance)
    return scenario if plain and all(part is None for part in parts) else None


def shown_in_memory(scenario: AnyScenario) -> RecordingScenario | None:
    """The scenario, if all it asks for is a simulated display for a stream that is complete; else
    None."""
    if not isinstance(scenario, RecordingScenario) or scenario.display is None:
        return None
    parts = scenario.link, scenario.code, scenario.camera, scenario.display.sink
    complete = scenario.sensor.source.startswith(FILE) and scenario.sensor.source_timeout is None
    return scenario if complete and all(part is None for part in parts) else None
