"""A test chart for a pursuing eye: a static part with greys and gratings, and moving strips. Its
greys, lines, text and shapes are drawn finer than pixels and averaged.

The static part has a grey wedge, labelled with the share of pixels that fire in a cycle, and groups
of fine lines. Below it, strips move to the right, four at PURSUIT and one at a quarter of it: text,
bars, an edge from dark to mid grey, and a face with other shapes. The layout is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Box, Plane
from cosim.report.figures import own_settings
from scenarios.scenes.drawing.canvas import check_instant, check_shape

Picture = npt.NDArray[np.float32]
FINE = 4
"""Number of fine columns and rows in a pixel."""
WHITE_RATE = 0.6
"""Spike rate of white for which the labels of the wedge hold, spikes a cycle: the default lens."""
WEDGE = (0.0015, 0.003, 0.006, 0.012, 0.03, 0.06, 0.12, 0.18, 0.3, 0.6)
"""Steps of the wedge: share of pixels that fire in a cycle."""
PAPER, INK, DARK, LIGHT = 0.42, 0.012, 0.03, 0.92
MIDDLE = 0.18 / WHITE_RATE
"""Mid grey, the bright side of the edge."""
LINES = (2, 3, 4, 6, 8, 12)
"""Periods of the groups of lines in a picture 1000 pixels wide, pixels."""
BITS = 4
"""Fractional bits of coordinates in fine pixels."""
PURSUIT = 4000.0
"""Speed of the fast strips, which an eye follows, pixels/s, for any size of picture."""
SLOW = 1000.0
"""Speed of the slow strip, pixels/s."""


class _Brush:
    """A canvas of `rows` x `columns` pixels, drawn in fine pixels. Coordinates are pixels, x to the
    right and y down."""

    def __init__(self, rows: int, columns: int, tone: float) -> None:
        self.rows, self.columns = rows, columns
        self.picture = np.full((rows * FINE, columns * FINE), tone, np.float32)

    def fill(self, outlines: list[Any], tone: float) -> None:
        """Fills closed outlines, (n, 2) x, y, by the even-odd rule."""
        import cv2

        # In OpenCV, pixel centres are at integers, and pixels that the outline touches are filled.
        fixed = [
            np.rint((np.asarray(o, np.float64) * FINE - 0.5) * 2**BITS).astype(np.int32)
            for o in outlines
        ]
        cv2.fillPoly(self.picture, fixed, tone, cv2.LINE_8, BITS)

    def box(self, x0: float, y0: float, x1: float, y1: float, tone: float) -> None:
        """Draws a rectangle, with sides rounded to fine pixels and at least one fine pixel wide."""
        a, b, c, d = (round(v * FINE) for v in (y0, y1, x0, x1))
        self.picture[max(a, 0) : max(b, a + 1), max(c, 0) : max(d, c + 1)] = tone

    def oval(
        self, x: float, y: float, a: float, b: float, tone: float,
        part: tuple[float, float] = (0.0, 360.0), inner: float = 0.0, turn: float = 0.0,
    ) -> None:  # fmt: skip
        """Draws an ellipse, or a ring.

        Args:
            x, y: centre.
            a, b: semi-axes.
            tone: reflectance.
            part: first and last angle, degrees clockwise from the right.
            inner: radius of the hole over the outer radius, 0 for none.
            turn: clockwise rotation, degrees.
        """
        angle = np.radians(np.linspace(*part, 181))
        around = np.stack([a * np.cos(angle), b * np.sin(angle)], axis=1)
        outline = np.concatenate([around, inner * around[::-1]]) if inner else around
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        self.fill([outline @ np.array([[c, s], [-s, c]]) + (x, y)], tone)

    def text(
        self, line: str, x: float, y: float, high: float, tone: float, wide: float | None = None
    ) -> float:
        """Draws a line of text centred at (x, y), with capitals of the height `high`, reduced to
        the width `wide`; returns its width."""
        outlines, across = _letters(line)
        if wide is not None and across * high > wide:
            high = wide / across
        self.fill([o * high + (x - across * high / 2, y + high / 2) for o in outlines], tone)
        return across * high

    def averaged(self, columns: bool = True) -> Picture:
        """Means over the fine rows of pixels, and over the fine columns unless `columns` is
        False."""
        many = self.picture.reshape(self.rows, FINE, self.columns * FINE).mean(axis=1)
        if columns:
            many = many.reshape(self.rows, self.columns, FINE).mean(axis=2)
        return np.asarray(many, np.float32)


@lru_cache(maxsize=32)
def _letters(line: str) -> tuple[list[npt.NDArray[np.float64]], float]:
    """Outlines of a line of text with capitals of height 1 above y = 0, and its width."""
    size = 200.0  # curves are cut into lines at a resolution of 1
    with own_settings():
        from matplotlib.font_manager import FontProperties
        from matplotlib.textpath import TextPath

        font = FontProperties(family="DejaVu Sans", weight="bold")  # comes with matplotlib
        capital, text = (TextPath((0, 0), each, size=size, prop=font) for each in ("H", line))
    high = capital.get_extents().height
    outlines = [np.asarray(o) * (1 / high, -1 / high) for o in text.to_polygons()]
    left = min(float(o[:, 0].min()) for o in outlines)
    right = max(float(o[:, 0].max()) for o in outlines)
    return [o - (left, 0.0) for o in outlines], right - left


def still(height: int, width: int) -> Picture:
    """The static part with the wedge and the lines, (height, width)."""
    brush = _Brush(height, width, PAPER)
    step = 0.94 * width / len(WEDGE)
    for n, share in enumerate(WEDGE):
        x = 0.03 * width + n * step
        brush.box(x, 0.025 * height, x + step, 0.125 * height, share / WHITE_RATE)
        name = f"{share * 100:g} %"
        brush.text(name, x + step / 2, 0.148 * height, 0.016 * height, INK, 0.9 * step)
    wide = 0.94 * width / (2 * len(LINES))
    for n, period in enumerate(np.repeat(LINES, 2)):
        pace = period * width / 1000
        many = int(0.88 * wide / pace)
        x0, y0 = round(0.03 * width + (n + 0.06) * wide), round(0.185 * height)
        x1, y1 = x0 + (many + 0.5) * pace, y0 + (many + 0.5) * pace
        brush.box(x0, y0, x1, y1, LIGHT)
        level = n % 2 == 1
        for m in range(many):  # first and last are light; dark covers whole pixels for even periods
            at = (y0 if level else x0) + (m + 0.5) * pace
            if level:
                brush.box(x0, at, x1, at + pace / 2, INK)
            else:
                brush.box(at, y0, at + pace / 2, y1, INK)
        if not level:
            middle = y0 + 0.88 * wide + 0.022 * height
            brush.text(f"{period} px", x0 + 0.94 * wide, middle, 0.016 * height, INK, 2 * wide)
    return brush.averaged()


def words(rows: int, width: int) -> Picture:
    """VIFORM, light on dark, (rows, width · FINE)."""
    brush = _Brush(rows, width, DARK)
    brush.text("VIFORM", 0.5 * width, 0.41 * rows, 0.56 * rows, LIGHT, 0.9 * width)
    line = "light  to  spikes  to  light"
    brush.text(line, 0.5 * width, 0.86 * rows, 0.13 * rows, MIDDLE, 0.9 * width)
    return brush.averaged(columns=False)


def bars(rows: int, width: int) -> Picture:
    """Groups of vertical bars, each as wide as its gaps, (rows, width · FINE)."""
    brush = _Brush(rows, width, PAPER)
    x, scale = 0.02 * width, width / 1000
    for bar, many in ((32, 4), (16, 6), (8, 8), (4, 10), (2, 12), (1, 16)):
        wide = bar * scale
        brush.box(x, 0.12 * rows, x + (2 * many - 1) * wide, 0.88 * rows, LIGHT)
        for m in range(many):
            brush.box(x + 2 * m * wide, 0.12 * rows, x + (2 * m + 1) * wide, 0.88 * rows, INK)
        x += (2 * many - 1) * wide + 24 * scale
    brush.oval(0.965 * width, 0.5 * rows, 0.36 * rows, 0.36 * rows, INK, inner=0.55)
    return brush.averaged(columns=False)


def edge(rows: int, width: int) -> Picture:
    """Dark in the first and the last quarter, mid grey between, (rows, width · FINE)."""
    brush = _Brush(rows, width, DARK)
    brush.box(0.25 * width, 0, 0.75 * width, rows, MIDDLE)
    return brush.averaged(columns=False)


def faces(rows: int, width: int) -> Picture:
    """A face, a star, a ball and a ring, (rows, width · FINE)."""
    brush = _Brush(rows, width, PAPER)
    unit = min(rows, width * 0.175)
    y = 0.5 * rows
    _face(brush, 0.17 * width, y, 0.46 * unit)
    _star(brush, 0.40 * width, y, 0.45 * unit)
    _ball(brush, 0.61 * width, y, 0.42 * unit)
    x = 0.84 * width
    for radius, tone in ((0.45, INK), (0.36, LIGHT), (0.27, INK), (0.18, LIGHT), (0.09, INK)):
        brush.oval(x, y, radius * unit, radius * unit, tone)
    return brush.averaged(columns=False)


def _face(brush: _Brush, x: float, y: float, r: float) -> None:
    """A face with hair, from the front; r is the distance from its centre to the crown."""
    brush.oval(x, y - 0.10 * r, 0.86 * r, 0.92 * r, 0.05)  # hair
    for side in (-1, 1):
        brush.oval(x + 0.70 * r * side, y + 0.10 * r, 0.13 * r, 0.20 * r, 0.50)  # ear
    brush.oval(x, y + 0.12 * r, 0.68 * r, 0.86 * r, 0.62)
    brush.oval(x, y - 0.46 * r, 0.66 * r, 0.40 * r, 0.05, (180, 360))  # fringe
    brush.oval(x - 0.22 * r, y - 0.42 * r, 0.46 * r, 0.20 * r, 0.05, turn=-14)
    brush.oval(x + 0.33 * r, y - 0.45 * r, 0.27 * r, 0.13 * r, 0.05, turn=24)
    for side in (-1, 1):
        eye = x + 0.29 * r * side
        brush.oval(eye, y - 0.13 * r, 0.17 * r, 0.045 * r, 0.08, turn=7 * side)  # brow
        brush.oval(eye, y + 0.05 * r, 0.145 * r, 0.085 * r, 0.95)
        brush.oval(eye, y + 0.05 * r, 0.075 * r, 0.08 * r, 0.03)
        brush.oval(eye + 0.025 * r, y + 0.02 * r, 0.022 * r, 0.022 * r, 0.98)
        brush.oval(x + 0.40 * r * side, y + 0.36 * r, 0.15 * r, 0.10 * r, 0.50)  # cheek
    brush.oval(x, y + 0.26 * r, 0.085 * r, 0.15 * r, 0.46)  # nose
    brush.oval(x - 0.02 * r, y + 0.20 * r, 0.055 * r, 0.15 * r, 0.66)
    brush.oval(x, y + 0.50 * r, 0.30 * r, 0.22 * r, 0.10, (0, 180))  # mouth
    brush.oval(x, y + 0.50 * r, 0.26 * r, 0.08 * r, 0.95, (0, 180))


def _star(brush: _Brush, x: float, y: float, r: float) -> None:
    angle = np.pi * (np.arange(10) / 5 - 0.5)
    radius = r * np.where(np.arange(10) % 2 == 0, 1.0, 0.42)
    outline = np.stack([x + radius * np.cos(angle), y + 0.05 * r + radius * np.sin(angle)], axis=1)
    brush.fill([outline], LIGHT)


def _ball(brush: _Brush, x: float, y: float, r: float) -> None:
    """A matt ball with light from the upper left."""
    # The box of fine pixels around the ball, within the picture.
    (top, low), (left, right) = (
        np.clip([math.floor((at - r) * FINE), math.ceil((at + r) * FINE)], 0, size)
        for at, size in zip((y, x), brush.picture.shape, strict=True)
    )
    box = brush.picture[top:low, left:right]
    rows, columns = np.ogrid[top:low, left:right]
    down, along = ((rows + 0.5) / FINE - y) / r, ((columns + 0.5) / FINE - x) / r
    inside = down**2 + along**2 < 1
    out = np.sqrt(np.maximum(1 - down**2 - along**2, 0))
    lit = np.maximum((-0.5 * along - 0.55 * down + 0.67 * out), 0)
    box[inside] = (0.02 + 0.88 * lit[inside]).astype(np.float32)


def slow(rows: int, width: int) -> Picture:
    """Text and bars, (rows, width · FINE)."""
    brush = _Brush(rows, width, LIGHT)
    line = "a quarter of the speed: 1000 pixels a second"
    brush.text(line, 0.44 * width, 0.5 * rows, 0.36 * rows, INK, 0.8 * width)
    for m in range(6):
        x = (0.89 + 0.016 * m) * width
        brush.box(x, 0.15 * rows, x + 0.008 * width, 0.85 * rows, INK)
    return brush.averaged(columns=False)


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
