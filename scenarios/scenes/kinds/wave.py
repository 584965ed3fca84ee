"""`wave`: a person who waves an arm."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Illuminance, Quantity, Section
from cosim.light.source import Source
from scenarios.scenes.drawing.sized import sized
from scenarios.scenes.kinds.grid import SceneGrid


class WaveScene(Section):
    """A person who waves an arm (Huang 2022, figures 3 to 5)."""

    kind: Literal["wave"]
    illuminance: Illuminance
    rate: Annotated[float, Quantity("frequency", least=0, most=6)] = Field(
        default=3.0, examples=["3 Hz"], description="waves per second"
    )

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes import numba, which takes a second.
        from scenarios.scenes.drawing.analytic import AnalyticSource
        from scenarios.scenes.people.wave import Wave

        def draw(shape: tuple[int, int]) -> Source:
            return AnalyticSource(Wave(shape, rate=self.rate), self.illuminance, grid.clock)

        return sized(grid.shape, draw)
