"""A test chart that an eye can pursue: still greys and gratings, and strips that slide by.

The still part holds a wedge of greys, named by the share of pixels that fire a cycle, and groups of
fine lines. Below it strips slide to the right, four at PURSUIT and one at a quarter of it: text,
bars, an edge from dark to mid grey, a face among shapes. What is drawn and where is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from cosim import Box, Plane
from scenarios.scenes.charts.chart_art import FINE, bars, edge, faces, slow, still, words
from scenarios.scenes.drawing.canvas import check_instant, check_shape

__all__ = ["PURSUIT", "SLOW", "Chart"]

PURSUIT = 4000.0
"""Pixels a second of the fast strips, at any size of picture: what an eye follows."""
SLOW = 1000.0
"""Of the slow one."""
STRIPS = (
    (0.325, 0.510, words, PURSUIT),
    (0.520, 0.610, bars, PURSUIT),
    (0.620, 0.720, edge, PURSUIT),
    (0.730, 0.905, faces, PURSUIT),
    (0.915, 0.985, slow, SLOW),
)
"""Rows (parts of the height) of each strip, what is on it, and its speed."""


@dataclass(frozen=True, eq=False)
class _Strip:
    """A strip of rows `top` to `low` that repeats every `width` pixels.

    Attributes:
        phases: (FINE, rows, 2 width) float32, the mean over a pixel that begins k / FINE pixels
            after each of the strip's columns; twice round, so that any shift is one slice.
    """

    top: int
    low: int
    speed: float
    phases: Plane

    def draw(self, image: Plane, t: float) -> None:
        """Lays the strip as at t seconds: pixel means of the fine strip, exact at any shift, since
        between two of its phases they run linearly."""
        width = image.shape[1]
        at = math.fmod(-self.speed * t, width) % width  # the strip's place at column 0
        fine = at * FINE
        number = int(fine)
        part = np.float32(fine - number)
        one, two = (self._slice(n % (width * FINE), width) for n in (number, number + 1))
        rows = image[self.top : self.low]
        np.multiply(two, part, out=rows)
        rows += one * (np.float32(1) - part)

    def _slice(self, number: int, width: int) -> Plane:
        column, phase = divmod(number, FINE)
        return self.phases[phase, :, column : column + width]


@dataclass(frozen=True)
class Chart:
    """The chart. shape: (height, width) in pixels, each 8 to 2000."""

    shape: tuple[int, int]

    def __post_init__(self) -> None:
        check_shape(self.shape)

    @property
    def pursuit(self) -> float:
        """Pixels a second along the rows, to the right, that an eye follows."""
        return PURSUIT

    def speed(self) -> float:
        """Of any edge at most, pixels per second."""
        return PURSUIT

    def reflectance(self, t: float) -> Plane:
        """Linear reflectance at t seconds, (H, W) float32, 0 to 1. ValueError if not finite."""
        t = check_instant(t)
        ground, strips = _drawn(self)
        image = ground.copy()
        for strip in strips:
            strip.draw(image, t)
        return image

    def moving(self, start: float, stop: float) -> Box:
        """(y0, y1, x0, x1), outside of which nothing changes between two instants in seconds."""
        strips = _drawn(self)[1]
        if not strips or start == stop:
            return 0, 0, 0, 0
        return strips[0].top, strips[-1].low, 0, self.shape[1]

    def edge_rows(self) -> tuple[int, int]:
        """Rows of the strip with the edge, the last excluded."""
        return _rows(self.shape[0], *STRIPS[2][:2])

    def edge_at(self, t: float) -> float:
        """Column (a float, 0 to the width) where dark meets mid grey to its right at t."""
        return (PURSUIT * check_instant(t) + self.shape[1] / 4) % self.shape[1]

    def points(self) -> list[tuple[int, int, str]]:
        """Characteristic pixels (row, column, label)."""
        height, width = self.shape

        def at(y: float, x: float) -> tuple[int, int]:
            return min(int(y * height), height - 1), min(int(x * width), width - 1)

        named = {
            "paper": (0.01, 0.5),
            "step 0.15 %": (0.08, 0.07),
            "step 18 %": (0.08, 0.70),
            "white step": (0.08, 0.93),
            "fine lines": (0.22, 0.08),
            "text passes": (0.42, 0.5),
            "bars pass": (0.565, 0.5),
            "edge passes": (0.67, 0.5),
            "face passes": (0.82, 0.5),
            "slow text passes": (0.95, 0.5),
        }
        return [(*at(y, x), label) for label, (y, x) in named.items()]


def _rows(height: int, top: float, low: float) -> tuple[int, int]:
    return round(top * height), round(low * height)


def _phases(fine: npt.NDArray[np.float32]) -> Plane:
    """(rows, width · FINE) fine columns to `_Strip.phases`."""
    rows, many = fine.shape
    wrapped = np.concatenate([fine, fine[:, : FINE - 1]], axis=1).astype(np.float64)
    sums = np.concatenate([np.zeros((rows, 1)), np.cumsum(wrapped, axis=1)], axis=1)
    means = np.clip((sums[:, FINE:] - sums[:, :-FINE]) / FINE, 0, 1)  # from each fine column on
    phases = means.reshape(rows, many // FINE, FINE).transpose(2, 0, 1)
    return np.concatenate([phases, phases], axis=2).astype(np.float32)


@lru_cache(maxsize=2)
def _drawn(chart: Chart) -> tuple[Plane, list[_Strip]]:
    """What stays, and the strips: kept beside the chart, so that it stays a plain value."""
    height, width = chart.shape
    strips = []
    for top, low, paint, speed in STRIPS:
        a, b = _rows(height, top, low)
        if a < b:
            strips.append(_Strip(a, b, speed, _phases(paint(b - a, width))))
    return still(height, width), strips
