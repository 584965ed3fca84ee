"""`star`: a rotating Siemens star."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Illuminance, Quantity, Section
from cosim.light.source import Source
from scenarios.scenes.drawing.sized import sized
from scenarios.scenes.kinds.grid import SceneGrid


class StarScene(Section):
    """A rotating Siemens star inside a ring of grey steps."""

    kind: Literal["star"]
    illuminance: Illuminance
    spokes: Annotated[int, Field(ge=2, le=360)] = 36
    rotation: Annotated[float, Quantity("frequency", least=0, most=1000)] = Field(
        default=4.0, examples=["4 Hz"], description="revolutions per second"
    )

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes import numba, which takes a second.
        from scenarios.scenes.charts.star import Star
        from scenarios.scenes.drawing.analytic import AnalyticSource

        def draw(shape: tuple[int, int]) -> Source:
            star = Star(shape, spokes=self.spokes, revolutions=self.rotation)
            return AnalyticSource(star, self.illuminance, grid.clock)

        return sized(grid.shape, draw)
