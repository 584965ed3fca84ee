"""`shockwave`: a shock wave forms as a quiet wind tunnel starts."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from cosim import InputError
from cosim.config.quantity import Illuminance, Quantity, Section, Time
from cosim.light.source import Source
from scenarios.scenes.kinds.grid import SceneGrid

__all__ = ["ShockwaveScene"]


class ShockwaveScene(Section):
    """A shock wave forms on a model as a quiet wind tunnel starts (Huang 2022, figure 6)."""

    kind: Literal["shockwave"]
    illuminance: Illuminance = Field(
        description="of the schlieren bench's lamp; white is all of it"
    )
    mach: Annotated[float, Field(ge=4, le=7)] = Field(default=6.0, description="of the nozzle")
    model: Literal["wedge", "sphere"] = "wedge"
    angle: Annotated[float, Quantity("angle", least=2, most=45)] = Field(
        default=15.0, description="half angle of a wedge"
    )
    radius: Annotated[float, Quantity("length", least=1250, most=15_625)] = Field(
        default=10_000.0, examples=["10 mm"], description="of a sphere"
    )
    start: Time = Field(
        default=0.002, examples=["2 ms"], description="instant at which the nozzle begins to flow"
    )
    chamber: Annotated[float, Quantity("pressure", above=0, most=1e6)] | None = Field(
        default=None,
        description="pressure in the test section before; 0.85 of what would stop it when absent",
    )
    knife: Annotated[float, Quantity("angle", least=-90, most=90)] = Field(
        default=45.0,
        examples=["45 deg"],
        description="direction of the gradient that is seen, against the flow",
    )

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes bring numba with them, a second of start-up that others need not wait for.
        from scenarios.scenes.drawing.paced import PacedSource
        from scenarios.scenes.flow.shockwave import Shockwave

        try:
            tunnel = Shockwave(
                grid.shape,
                mach=self.mach,
                model=self.model,
                angle=math.radians(self.angle),
                radius=self.radius * 1e-6,
                start=self.start,
                chamber=self.chamber,
                knife=math.radians(self.knife),
            )
        except ValueError as exc:  # what no single key's limits can say, in the scene's own words
            name, _, rest = str(exc).partition(" must be ")
            must, _, value = rest.rpartition(", not ")
            raise InputError(f"scene.{name}", must, value, "change it") from exc
        source = PacedSource(tunnel, self.illuminance, grid.clock, grid.aligned)
        if tunnel.episodes()[-1][1] * grid.clock.hz > grid.cycles:
            source.degraded.append("the run ends before the flow is steady: lengthen duration")
        return source
