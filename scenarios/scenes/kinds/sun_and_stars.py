"""`sun-and-stars`: discs of known illuminance over many decades."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Illuminance, Quantity, Section
from cosim.light.source import Source
from scenarios.scenes.charts.sky import SkySource
from scenarios.scenes.kinds.grid import SceneGrid


class SunAndStarsScene(Section):
    """The sun, and stars of decreasing illuminance, as discs of known light (Huang 2022, section
    4.5)."""

    kind: Literal["sun-and-stars"]
    illuminance: Illuminance = Field(description="illuminance of the disc of the sun")
    dimmest: Illuminance = Field(
        default=1e-6, examples=["1e-6 lux"], description="illuminance of the dimmest star"
    )
    background: Annotated[float, Quantity("illuminance", least=0, most=1e9)] = Field(
        default=0.0, examples=["0.001 lux"], description="illuminance between the stars"
    )

    def source(self, grid: SceneGrid) -> Source:
        return SkySource(grid.shape, self.illuminance, self.dimmest, self.background, grid.clock)
