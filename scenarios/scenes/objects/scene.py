"""The scene of plates: its light at any instant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosim import Box, Plane
from scenarios.scenes.drawing.canvas import check_instant
from scenarios.scenes.drawing.points import spread_points
from scenarios.scenes.objects.arrangement import arrange
from scenarios.scenes.objects.painting import Tables, paint, tabulate
from scenarios.scenes.objects.plate import Matrix, Plate


@dataclass(frozen=True)
class Objects:
    """An `AnalyticScene` of plates at several depths.

    Attributes:
        shape: (height, width), pixels.
        layout: seed of the plates, their motion and their textures.
        count: number of plates.
        pace: greatest speed of a centre, shorter sides of the picture a second.
    """

    shape: tuple[int, int]
    layout: int = 1
    count: int = 8
    pace: float = 8.0

    @cached_property
    def plates(self) -> tuple[Plate, ...]:
        """The background, then the plates, the farthest first."""
        side = min(self.shape)
        return arrange(
            self.layout, self.count, self.pace, self.shape[1] / side, self.shape[0] / side
        )

    @cached_property
    def tables(self) -> Tables:
        """The plates for compiled loops."""
        return tabulate(self.plates)

    def homographies(self, t: float) -> Matrix:
        """That of each plate at t, s, (n, 3, 3)."""
        instant = check_instant(t)
        return np.stack([plate.homography(instant, self.shape) for plate in self.plates])

    def reflectance(self, t: float) -> Plane:
        """Reflectance at t, s, (H, W) float32 in [0, 1]."""
        image: Plane = paint(self.tables, self.homographies(t), self.shape)
        return image

    def speed(self) -> float:
        """Upper bound of the speed of any point in the picture, pixels/s."""
        return max(plate.speed(self.shape) for plate in self.plates)

    def moving(self, start: float, stop: float) -> Box:
        """The whole picture: its background moves."""
        if start == stop or self.pace == 0:
            return 0, 0, 0, 0
        return 0, self.shape[0], 0, self.shape[1]

    def points(self) -> list[tuple[int, int, str]]:
        return spread_points(self.shape)
