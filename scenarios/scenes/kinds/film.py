"""`film`: a video clip, an image, or the built-in moving scene."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from cosim import InputError
from cosim.config.quantity import Frequency, Illuminance, Section, Time
from cosim.light.source import Source
from scenarios.scenes.drawing.sized import sized
from scenarios.scenes.kinds.grid import SceneGrid


class FilmScene(Section):
    """A clip or pictures, see `open_clip`; without a path, the built-in moving scene."""

    kind: Literal["film"] = "film"
    path: str | None = Field(
        default=None,
        description="clip, image, folder of images, or .npy file; by default the built-in scene",
    )
    drawn: Literal["chart", "colour-chart"] = Field(
        default="chart",
        description="built-in scene, used without a path: a moving chart, or 24 colours at rest",
    )
    start: Time = 0.0
    frame_rate: Frequency | None = Field(
        default=None,
        examples=["240 Hz"],
        description="replaces the frame rate of the clip; a folder and an array need it",
    )
    interpolation: Literal["linear", "motion"] = Field(
        default="linear",
        description="light between two frames of a clip: linear in time, or moved along the "
        "optical flow where the flows forward and backward agree",
    )
    illuminance: Illuminance = Field(
        description="illuminance of the scene; the white of the clip has reflectance 1"
    )

    def source(self, grid: SceneGrid) -> Source:
        # Drawn scenes import numba, which takes a second.
        if self.path is not None:
            from scenarios.scenes.clips.film import FilmSource
            from scenarios.scenes.clips.motion_film import MotionFilm

            film = MotionFilm if self.interpolation == "motion" else FilmSource
            return film(
                Path(self.path), grid.shape, self.illuminance, grid.clock, grid.cycles, self.start,
                self.frame_rate, grid.mosaic,
            )  # fmt: skip
        if self.interpolation != "linear":
            raise InputError(
                "scene.interpolation", "linear for a scene that is no clip", "motion",
                "leave it out, or give a clip as scene.path",
            )  # fmt: skip
        if self.drawn == "colour-chart":
            from scenarios.scenes.charts.patches import ColourChart

            return ColourChart(grid.shape, self.illuminance, grid.mosaic)
        from scenarios.scenes.charts.chart import Chart
        from scenarios.scenes.drawing.analytic import AnalyticSource

        return sized(
            grid.shape, lambda shape: AnalyticSource(Chart(shape), self.illuminance, grid.clock)
        )
