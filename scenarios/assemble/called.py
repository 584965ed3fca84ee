"""The camera of a scenario in memory; which scenarios a camera or a display in memory can do,
without a run."""

from __future__ import annotations

from dataclasses import replace

from cosim.compute.opencl import Device, shared_device
from cosim.run.inputs import FILE
from scenarios.assemble.schema.scenario import AnyScenario, RecordingScenario, Scenario
from scenarios.scenes.kinds.film import FilmScene
from sensor.latched.core import Filmed, LatchedCamera
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier


def called_camera(
    scenario: Scenario, setting: CameraSetting, device: Device | None, tier: Tier | None = None
) -> LatchedCamera:
    """The camera of a scenario, to be called. setting: of it; device, tier: see `LatchedCamera`."""
    return LatchedCamera(
        setting, device, tolerance=scenario.tolerance, window=scenario.image.window,
        floor=scenario.image.floor, tier=tier, duplicated_rows=scenario.sensor.duplicated_rows,
        draws=scenario.draws,
    )  # fmt: skip


def filmed_in_memory(scenario: AnyScenario) -> Scenario | None:
    """The scenario, if all it asks for is a simulated camera; else None."""
    if not isinstance(scenario, Scenario):
        return None
    sensor = scenario.sensor
    parts = (
        scenario.display, scenario.link, scenario.code, scenario.camera, scenario.readout,
        sensor.source, sensor.sub_threshold,
    )  # fmt: skip
    return scenario if all(part is None for part in parts) else None


def in_memory(scenario: AnyScenario) -> Scenario | None:
    """The scenario, if all it asks for is a simulated camera before frames that are given to it;
    else None."""
    found = filmed_in_memory(scenario)
    if found is None:
        return None
    plain = FilmScene.model_construct(illuminance=found.scene.illuminance)
    return found if found.scene == plain else None


def film_in_memory(scenario: Scenario, device: str | None) -> Filmed:
    """The stream of the scenario's run, without its check, folder and report.

    Args:
        scenario: one of `filmed_in_memory`, of a latched camera.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.

    Raises:
        InputError: it cannot be filmed.
    """
    from scenarios.assemble.source.latched.setup import set_up_camera  # a display needs none of it

    setup = replace(set_up_camera(scenario, device), device=shared_device(device))
    camera = called_camera(scenario, setup.setting, setup.device)
    relay = setup.lens.relay(setup.setting.chip.pitch)
    seen = camera.film(setup.source, relay, setup.cycles, spans=setup.spans)
    notes = (*setup.choice.notes, *seen.notes)
    return replace(seen, notes=notes, white_rate=setup.white_rate)


def shown_in_memory(scenario: AnyScenario) -> RecordingScenario | None:
    """The scenario, if all it asks for is a simulated display for a stream that is complete; else
    None."""
    if not isinstance(scenario, RecordingScenario) or scenario.display is None:
        return None
    parts = scenario.link, scenario.code, scenario.camera, scenario.display.sink
    complete = scenario.sensor.source.startswith(FILE) and scenario.sensor.source_timeout is None
    return scenario if complete and all(part is None for part in parts) else None
