"""A moving test chart: a rotating Siemens star with a grey wedge and groups of fine lines.

The spatial frequency of the star increases towards its centre without limit, so one image shows
resolution, blur and modulation of a camera; the wedge shows its linearity. The star is a target of
ISO 12233:2017, annex E (sine spokes).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from scenarios.scenes.drawing.canvas import (
    Canvas,
    Drawn,
    Item,
    Layer,
    View,
    check_instant,
    check_number,
    check_shape,
    ellipse,
    everywhere,
)
from scenarios.scenes.drawing.shading import Array, square_mean
from scenarios.scenes.drawing.shapes import Cam, Win, cover, grid, lay

TAU = 2 * math.pi
Profile = Literal["square", "sine"]

# Layout over the shorter side of the picture (assumed): radius of the star, inner and outer radius
# of the wedge; tones of the background.
RADIUS, RING_IN, RING_OUT = 0.36, 0.385, 0.445
PAPER, BLACK = 0.55, 0.02
STEPS = tuple((m + 1) / 8 for m in range(8))
"""The wedge: eight reflectances in equal steps up to white."""
LINES = (400.0, 200.0, 150.0, 100.0, 50.0)
"""Line pairs of the groups in the corners per shorter side; 500 is Nyquist at 1000 pixels."""


def _phase(x: Any, y: Any, pixel: float, n: int) -> tuple[Any, Any]:
    """Phase of the pixels in the star at rest, and their width, spoke periods."""
    r = np.sqrt(x * x + y * y)
    return (n / TAU) * np.arctan2(y, x), n * pixel / (TAU * np.maximum(r, 1e-6 * pixel))


def _wave(phase: Any, width: Any, profile: Profile) -> Array:
    """Mean over pixels of a Siemens star, -1 to 1: "square" is 1 on a spoke and -1 in a gap, "sine"
    is sin(n angle) for n spokes.

    The mean over the square pixel is approximated by the exact mean over a box along the circle,
    with the width of the pixel. A square has the variance of this box, 1/12, in every direction, so
    the two agree to second order. Measured errors against the mean of 64 x 64 points in each pixel,
    for 36 spokes: for periods of 4 pixels or more, sine 0.0002 RMS and at most 0.0009, square 0.02
    RMS and at most 0.09 (an edge along the diagonal); for 2 to 4 pixels, sine 0.002 RMS and square
    0.03; below one pixel, where any wave is an alias, 0.1 RMS.

    Args:
        phase: phase of the pixels, spoke periods.
        width: their width, spoke periods.
        profile: see above.
    """
    if profile == "sine":
        return np.asarray(np.sin(TAU * phase) * np.sinc(width))
    return np.asarray(2.0 * square_mean(phase, width) - 1.0)


@lru_cache(maxsize=192)
def _geometry(win: Win, cam: Cam, n: int) -> tuple[Any, ...]:
    """The part of the star that does not depend on its rotation: phase and width of the pixels, and
    their coverage by the disc. The cache holds the bands of about 3 million pixels, in float32
    (1e-6 of a period)."""
    px, py = grid(win, cam)
    part = cover((np.sqrt(px * px + py * py) - RADIUS) / cam[0])
    return tuple(a.astype(np.float32) for a in (*_phase(px, py, cam[0], n), part))


def paint_star(image: Any, win: Win, cam: Cam, star: Star, turn: float) -> None:
    """Paints the disc of a star, with the tone mean (1 + contrast wave), rotated by `turn` spoke
    periods."""
    phase, width, part = _geometry(win, cam, star.spokes)
    wave = _wave(phase - np.float32(turn), width, star.profile)
    lay(image, win, part, np.float32(star.mean) * (1 + np.float32(star.contrast) * wave))


def paint_wedge(image: Any, win: Win, cam: Cam, inner: float, outer: float) -> None:
    """Paints the ring of grey steps, the darkest first, clockwise from the top. The borders between
    steps are radii, blended over the width of a pixel."""
    x, y = grid(win, cam)
    r = np.hypot(x, y)
    d = np.maximum(r - outer, inner - r)
    place = np.mod(np.arctan2(x, -y) / TAU, 1.0) * len(STEPS)
    width = np.maximum(r, inner) * TAU / len(STEPS) / cam[0]  # pixels along one step
    near = np.round(place)
    after = cover((near - place) * width)  # share beyond the nearest border
    tones = np.asarray(STEPS)
    index = near.astype(np.int64)
    low, high = tones[(index - 1) % len(STEPS)], tones[index % len(STEPS)]
    lay(image, win, cover(d / cam[0]), low + after * (high - low))


def paint_lines(
    image: Any, win: Win, cam: Cam, box: tuple[float, float, float, float], period: float,
    upright: bool,
) -> None:  # fmt: skip
    """Paints black lines of the period `period`, m, on white, by exact means over pixels; `upright`
    for vertical lines."""
    x, y = grid(win, cam)
    x0, y0, x1, y1 = box
    part = cover(np.maximum(x0 - x, x - x1) / cam[0]) * cover(np.maximum(y0 - y, y - y1) / cam[0])
    phase = (x - x0 if upright else y - y0) / period
    lay(image, win, part, 1.0 - (1.0 - BLACK) * square_mean(phase, cam[0] / period))


@dataclass(frozen=True)
class Star(Drawn):
    """A Siemens star that rotates clockwise in the centre of a static chart. The shorter side of
    the picture is 1 m.

    Attributes:
        shape: (height, width), pixels, each 8 to 2000.
        spokes: number of bright spokes, 2 to 360.
        revolutions: revolutions per second, -1000 to 1000; negative for counter-clockwise.
        profile: "square" or "sine" across a spoke.
        contrast: (bright - dark) / (bright + dark), 0 to 1.
        mean: mean reflectance of the star, above 0, with mean (1 + contrast) at most 1.
        phase: revolutions at t = 0.

    Raises:
        ValueError: a value is out of range.
    """

    shape: tuple[int, int]
    spokes: int = 36
    revolutions: float = 25.0
    profile: Profile = "square"
    contrast: float = 0.9
    mean: float = 0.5
    phase: float = 0.0

    def __post_init__(self) -> None:
        check_shape(self.shape)
        if not isinstance(self.spokes, (int, np.integer)):
            raise ValueError(f"spokes must be an integer, not {self.spokes}")
        check_number("spokes", self.spokes, 2, 360)
        check_number("revolutions", self.revolutions, -1000.0, 1000.0, "per second")
        if self.profile not in ("square", "sine"):
            raise ValueError(f'profile must be "square" or "sine", not {self.profile!r}')
        check_number("contrast", self.contrast, 0.0, 1.0)
        check_number("mean", self.mean, 1e-3, 1.0)
        if self.mean * (1 + self.contrast) > 1 + 1e-9:
            raise ValueError(
                f"mean must be at most 1 / (1 + contrast) = {1 / (1 + self.contrast):.4g}, "
                f"not {self.mean}"
            )
        check_number("phase", self.phase, -1.0, 1.0, "revolutions")

    @property
    def _view(self) -> View:
        return View(self.shape, 1.0)

    def canvas(self) -> Canvas:
        return _canvas(self)

    def speed(self) -> float:
        """Speed of the spokes at the rim, 2 pi f R, the greatest speed, pixels/s."""
        return TAU * abs(self.revolutions) * RADIUS * min(self.shape)

    def angle(self, t: float) -> float:
        """Angle of the start of the first spoke at t, rad, clockwise from the x axis (to the
        right), 0 to 2 pi. Whole turns are removed before the multiplication by 2 pi."""
        turns = math.fmod(self.revolutions * check_instant(t), 1.0) + self.phase
        return TAU * math.fmod(math.fmod(turns, 1.0) + 1.0, 1.0)

    def points(self) -> list[tuple[int, int, str]]:
        """Characteristic pixels (row, column, label)."""
        view = self._view
        ring = 0.5 * (RING_IN + RING_OUT)
        at = {
            "paper": (0.0, -0.475),
            "centre": (0.0, 0.0),
            "spokes, 1/8 radius": (RADIUS / 8, 0.0),
            "spokes, 1/4 radius": (RADIUS / 4, 0.0),
            "spokes, 1/2 radius": (RADIUS / 2, 0.0),
            "spokes, 3/4 radius": (-0.75 * RADIUS, 0.0),
            "rim": (0.0, 0.96 * RADIUS),
            "black ring": (0.0, 0.5 * (RADIUS + RING_IN)),
        }
        points = [(*view.point(x, y), label) for label, (x, y) in at.items()]
        for m in (0, 3, 7):
            angle = (m + 0.5) / len(STEPS) * TAU
            x, y = ring * math.sin(angle), -ring * math.cos(angle)
            points.append((*view.point(x, y), f"step {STEPS[m]:g}"))
        return points


@lru_cache(maxsize=2)
def _canvas(star: Star) -> Canvas:
    """The layers of the chart, cached here so that `Star` remains a plain value."""
    still = [
        everywhere(PAPER),
        *_corners(),
        ellipse(0, 0, RING_OUT + 0.012, RING_OUT + 0.012, BLACK),
        Item((-RING_OUT, -RING_OUT, RING_OUT, RING_OUT), paint_wedge, (RING_IN, RING_OUT)),
    ]
    extent = (-RADIUS, -RADIUS, RADIUS, RADIUS)

    def disc(t: float) -> list[Item]:
        turn = star.angle(t) / TAU * star.spokes
        return [Item(extent, paint_star, (star, turn))]

    speed = star.speed() / min(star.shape)
    return Canvas(
        star._view,
        (Layer(tuple(still)), Layer(items=disc, speed=speed, reach=extent)),
    )


def _corners() -> list[Item]:
    """Five groups of lines in each corner, arranged as an L with the finest in the corner itself,
    alternately vertical and horizontal, so that each frequency has both directions."""
    side, step, edge = 0.050, 0.056, 0.449
    places = ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2))
    items = []
    for m, (sx, sy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        for k, (pairs, (a, b)) in enumerate(zip(LINES, places, strict=True)):
            x, y, h = sx * (edge - a * step), sy * (edge - b * step), 0.5 * side
            box = (x - h, y - h, x + h, y + h)
            items.append(Item(box, paint_lines, (box, 1.0 / pairs, (k + m) % 2 == 0)))
    return items
