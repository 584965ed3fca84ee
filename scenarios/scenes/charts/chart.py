"""A test chart for a pursuing eye: a static part with greys and gratings, and moving strips.

The static part has a grey wedge, labelled with the share of pixels that fire in a cycle, and groups
of fine lines. Below it, strips move to the right, four at PURSUIT and one at a quarter of it: text,
bars, an edge from dark to mid grey, and a face with other shapes. The layout is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Box, Plane
from scenarios.scenes.charts.chart_art import FINE, bars, edge, faces, slow, still, words
from scenarios.scenes.drawing.canvas import check_instant, check_shape

PURSUIT = 4000.0
"""Speed of the fast strips, which an eye follows, pixels/s, for any size of picture."""
SLOW = 1000.0
"""Speed of the slow strip, pixels/s."""
STRIPS = (
    (0.325, 0.510, words, PURSUIT),
    (0.520, 0.610, bars, PURSUIT),
    (0.620, 0.720, edge, PURSUIT),
    (0.730, 0.905, faces, PURSUIT),
    (0.915, 0.985, slow, SLOW),
)
"""First and last row of each strip over the height, the function that draws it, and its speed."""


@njit(cache=True, nogil=True)
def _mix(one, two, part, out):  # type: ignore[no-untyped-def]
    """out = two part + one (1 - part), all float32; in one pass, as memory is the limit."""
    rest = np.float32(1.0) - part
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            out[y, x] = two[y, x] * part + one[y, x] * rest


@dataclass(frozen=True, eq=False)
class _Strip:
    """A moving strip, periodic with the width of the picture.

    Attributes:
        top, low: first row, and the row after the last.
        speed: speed to the right, pixels/s.
        phases: (FINE, rows, 2 width) float32, the mean over a pixel that begins k / FINE pixels
            after each column of the strip; two periods, so that any shift is one slice.
    """

    top: int
    low: int
    speed: float
    phases: Plane

    def draw(self, image: Plane, t: float) -> None:
        """Draws the strip at t, s: pixel means of the fine strip. They are exact at any shift,
        because they are linear between two phases."""
        width = image.shape[1]
        at = math.fmod(-self.speed * t, width) % width  # position on the strip at column 0
        fine = at * FINE
        number = int(fine)
        part = np.float32(fine - number)
        one, two = (self._slice(n % (width * FINE), width) for n in (number, number + 1))
        _mix(one, two, part, image[self.top : self.low])

    def _slice(self, number: int, width: int) -> Plane:
        column, phase = divmod(number, FINE)
        return self.phases[phase, :, column : column + width]


@dataclass(frozen=True)
class Chart:
    """The chart. `shape`: (height, width), pixels, each 8 to 2000."""

    shape: tuple[int, int]

    def __post_init__(self) -> None:
        check_shape(self.shape)

    @property
    def pursuit(self) -> float:
        """Speed along the rows, to the right, that an eye follows, pixels/s."""
        return PURSUIT

    def speed(self) -> float:
        """Greatest speed of any edge, pixels/s."""
        return PURSUIT

    def reflectance(self, t: float) -> Plane:
        """Linear reflectance at t, s, (H, W) float32 in [0, 1]. Raises ValueError unless t is
        finite."""
        t = check_instant(t)
        ground, strips = _layers(self)
        image = ground.copy()
        for strip in strips:
            strip.draw(image, t)
        return image

    def moving(self, start: float, stop: float) -> Box:
        """Box (y0, y1, x0, x1) that contains all changes between two instants, s."""
        strips = _layers(self)[1]
        if not strips or start == stop:
            return 0, 0, 0, 0
        return strips[0].top, strips[-1].low, 0, self.shape[1]

    def edge_rows(self) -> tuple[int, int]:
        """First row of the strip with the edge, and the row after its last."""
        return _rows(self.shape[0], *STRIPS[2][:2])

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
    """`_Strip.phases` of a fine strip (rows, width · FINE)."""
    rows, many = fine.shape
    wrapped = np.concatenate([fine, fine[:, : FINE - 1]], axis=1).astype(np.float64)
    sums = np.concatenate([np.zeros((rows, 1)), np.cumsum(wrapped, axis=1)], axis=1)
    means = np.clip((sums[:, FINE:] - sums[:, :-FINE]) / FINE, 0, 1)  # from each fine column on
    phases = means.reshape(rows, many // FINE, FINE).transpose(2, 0, 1)
    return np.concatenate([phases, phases], axis=2).astype(np.float32)


@lru_cache(maxsize=2)
def _layers(chart: Chart) -> tuple[Plane, list[_Strip]]:
    """The static part and the strips, cached here so that `Chart` remains a plain value."""
    height, width = chart.shape
    strips = []
    for top, low, paint, speed in STRIPS:
        a, b = _rows(height, top, low)
        if a < b:
            strips.append(_Strip(a, b, speed, _phases(paint(b - a, width))))
    return still(height, width), strips
