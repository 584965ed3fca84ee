"""`shockwave`: the formation of a shock wave at the start of a quiet wind tunnel."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from cosim import InputError
from cosim.config.quantity import Illuminance, Quantity, Section, Time
from cosim.light.source import Source
from scenarios.scenes.drawing.sized import sized
from scenarios.scenes.kinds.grid import SceneGrid


class ShockwaveScene(Section):
    """Formation of a shock wave on a model at the start of a quiet wind tunnel (Huang 2022, figure
    6)."""

    kind: Literal["shockwave"]
    illuminance: Illuminance = Field(
        description="illuminance by the lamp of the schlieren bench, which is white"
    )
    mach: Annotated[float, Field(ge=4, le=7)] = Field(
        default=6.0, description="Mach number of the nozzle"
    )
    model: Literal["wedge", "sphere"] = "wedge"
    angle: Annotated[float, Quantity("angle", least=2, most=45)] = Field(
        default=15.0, description="half angle of a wedge"
    )
    radius: Annotated[float, Quantity("length", least=1250, most=15_625)] = Field(
        default=10_000.0, examples=["10 mm"], description="radius of a sphere"
    )
    start: Time = Field(
        default=0.002, examples=["2 ms"], description="instant at which the nozzle flow starts"
    )
    chamber: Annotated[float, Quantity("pressure", above=0, most=1e6)] | None = Field(
        default=None,
        description="pressure in the test section before the start; by default 0.85 of the "
        "pressure at which the tunnel does not start",
    )
    knife: Annotated[float, Quantity("angle", least=-90, most=90)] = Field(
        default=45.0,
        examples=["45 deg"],
        description="angle between the visible density gradient and the flow",
    )

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes import numba, which takes a second.
        from scenarios.scenes.drawing.paced import PacedSource
        from scenarios.scenes.flow.shockwave import Shockwave

        def draw(shape: tuple[int, int]) -> PacedSource:
            tunnel = Shockwave(
                shape,
                mach=self.mach,
                model=self.model,
                angle=math.radians(self.angle),
                radius=self.radius * 1e-6,
                start=self.start,
                chamber=self.chamber,
                knife=math.radians(self.knife),
            )
            source = PacedSource(tunnel, self.illuminance, grid.clock, grid.aligned)
            if tunnel.episodes()[-1][1] * grid.clock.hz > grid.cycles:
                source.degraded.append("the run ends before the flow is steady: lengthen duration")
            return source

        try:
            return sized(grid.shape, draw)
        except ValueError as exc:  # limits that depend on several keys
            name, _, rest = str(exc).partition(" must be ")
            must, _, value = rest.rpartition(", not ")
            raise InputError(f"scene.{name}", must, value, "write a value of these") from exc
