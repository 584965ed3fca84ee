"""`objects`: textured plates that move at several depths, with dense truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Illuminance, Section
from cosim.light.source import Source
from scenarios.scenes.kinds.grid import SceneGrid

if TYPE_CHECKING:
    from scenarios.scenes.objects.scene import Objects


class ObjectsScene(Section):
    """Textured plates that move, turn and come closer at several depths and cover each other. Flow,
    depth, masks and boxes are known in closed form."""

    kind: Literal["objects"]
    illuminance: Illuminance
    layout: Annotated[int, Field(ge=0, lt=2**32)] = Field(
        default=1, description="seed of the plates, their motion and textures"
    )
    objects: Annotated[int, Field(ge=0, le=64)] = Field(default=8, description="number of plates")
    speed: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=8.0, description="greatest speed, shorter sides of the picture a second"
    )

    def closed_form(self, shape: tuple[int, int]) -> Objects:
        """The scene with its dense truth, on (height, width) pixels."""
        from scenarios.scenes.objects.scene import Objects

        return Objects(shape, self.layout, self.objects, self.speed)

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes import numba, which takes a second.
        from scenarios.scenes.drawing.analytic import AnalyticSource

        return AnalyticSource(self.closed_form(grid.shape), self.illuminance, grid.clock)
