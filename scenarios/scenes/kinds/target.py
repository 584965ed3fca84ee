"""`target`: a static chart or picture under variable light."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from cosim.config.quantity import Illuminance, Section, Time
from cosim.light.source import Source
from scenarios.scenes.kinds.grid import SceneGrid


class TargetScene(Section):
    """A static test chart or picture under variable light."""

    kind: Literal["target"]
    illuminance: Illuminance
    chart: Literal["night", "bars", "landolt", "steps", "discs"] = Field(
        default="night",
        description="night: bars, rings and steps on one sheet; discs: spots of light",
    )
    contrast: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="factor of the contrast with the grey of the sheet"
    )
    path: str | None = Field(default=None, description="a picture instead of the chart")
    course: tuple[tuple[Time, Annotated[float, Field(ge=0, le=1e12)]], ...] = Field(
        default=((0.0, 1.0),),
        min_length=1,
        max_length=1000,
        description="factor of all light: [time, factor] in order of time, with linear "
        "interpolation, constant outside; two entries at one time are a step",
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
        from scenarios.scenes.charts.target import TargetSource  # imports numba

        return TargetSource(self, grid.shape)
