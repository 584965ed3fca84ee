"""`step`: a grey wedge under a step of light."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cosim.config.quantity import Illuminance, Reflectance, Section, Time
from cosim.light.source import Source
from scenarios.scenes.charts.patches import StepSource
from scenarios.scenes.kinds.grid import SceneGrid


class StepScene(Section):
    """A grey wedge whose illumination steps from one level to another at one instant."""

    kind: Literal["step"]
    illuminance: Illuminance
    before: Reflectance = 0.1
    after: Reflectance = 0.9
    at: Time = Field(default=0.032, examples=["32 ms"], description="instant of the step")

    def source(self, grid: SceneGrid) -> Source:
        stop = grid.clock.edge(grid.cycles)
        return StepSource(grid.shape, self.illuminance, self.before, self.after, self.at, stop)
