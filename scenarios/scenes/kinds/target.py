"""`target`: a chart or a picture that stands still, under light that changes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from cosim.config.quantity import Illuminance, Section, Time
from cosim.light.source import Source
from scenarios.scenes.kinds.grid import SceneGrid

__all__ = ["TargetScene"]


class TargetScene(Section):
    """A test chart that does not move, under light that changes."""

    kind: Literal["target"]
    illuminance: Illuminance
    chart: Literal["night", "bars", "landolt", "steps", "discs"] = Field(
        default="night", description="night: bars, rings and steps on one sheet; discs: light spots"
    )
    contrast: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="reflectances are pulled towards the sheet's grey by it"
    )
    path: str | None = Field(default=None, description="a picture in the chart's place")
    course: tuple[tuple[Time, Annotated[float, Field(ge=0, le=1e12)]], ...] = Field(
        default=((0.0, 1.0),),
        min_length=1,
        max_length=1000,
        description="factor of all light: [time, factor] in order, linear between, constant "
        "outside; two at one time are a jump",
        examples=[[["0 ms", 1], ["500 ms", 1e4]]],
        json_schema_extra={"default": [["0 s", 1.0]]},
    )

    @field_validator("course")
    @classmethod
    def _in_order(cls, course: tuple[tuple[float, float], ...]) -> Any:
        times = [time for time, _ in course]
        if times != sorted(times):
            raise ValueError("must be knots in order of time")
        return course

    def source(self, grid: SceneGrid) -> Source:
        from scenarios.scenes.charts.target import TargetSource  # brings numba with it

        return TargetSource(self, grid.shape)
