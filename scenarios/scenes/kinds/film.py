"""`film`: a clip or an image, or a drawn scene that moves."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from cosim.config.quantity import Frequency, Illuminance, Section, Time
from cosim.light.source import Source
from scenarios.scenes.kinds.grid import SceneGrid

__all__ = ["FilmScene"]


class FilmScene(Section):
    """A clip or an image that PyAV opens; without a path a built-in moving scene."""

    kind: Literal["film"] = "film"
    path: str | None = Field(
        default=None, description="clip or image; the built-in scene when absent"
    )
    drawn: Literal["chart"] = Field(
        default="chart", description="built-in moving scene when there is no path"
    )
    start: Time = 0.0
    frame_rate: Frequency | None = Field(
        default=None, examples=["240 Hz"], description="overrides the clip's own"
    )
    illuminance: Illuminance = Field(description="falls on the scene; clip white reflects all")

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes bring numba with them, a second of start-up that others need not wait for.
        if self.path is not None:
            from scenarios.scenes.clips.film import FilmSource

            return FilmSource(
                Path(self.path), grid.shape, self.illuminance, grid.clock, grid.cycles, self.start,
                self.frame_rate,
            )  # fmt: skip
        from scenarios.scenes.charts.chart import Chart
        from scenarios.scenes.drawing.analytic import AnalyticSource

        return AnalyticSource(Chart(grid.shape), self.illuminance, grid.clock)
