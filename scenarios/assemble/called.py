"""Which scenarios a camera in memory can film, without a run."""

from __future__ import annotations

from scenarios.assemble.schema.scenario import AnyScenario, Scenario
from scenarios.scenes.kinds.film import FilmScene

__all__ = ["in_memory"]


def in_memory(scenario: AnyScenario) -> Scenario | None:
    """The scenario, if all it asks for is a simulated latched camera before frames that are given
    to it; else None."""
    if not isinstance(scenario, Scenario):
        return None
    sensor, scene = scenario.sensor, scenario.scene
    parts = (
        scenario.display, scenario.link, scenario.code, scenario.camera, scenario.readout,
        sensor.source, sensor.sub_threshold,
    )  # fmt: skip
    plain = scene == FilmScene.model_construct(illuminance=scene.illuminance)
    simulated = sensor.readout == "synchronous" and all(part is None for part in parts)
    return scenario if plain and simulated else None
