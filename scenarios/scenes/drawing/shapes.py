"""Shapes of analytic scenes: their coverage of pixels.

Lengths are metres in the picture plane, x to the right, y down, with the origin in the centre of
the picture; tones are linear reflectance in [0, 1]. A painter composes one shape with the picture
below it ("over", Porter and Duff, SIGGRAPH 1984), or multiplies the picture by a factor.

Coverage is clip(0.5 - d, 0, 1) with the signed distance d from the centre of the pixel to the edge
of the shape, pixels. It is exact for a straight edge along the side of the pixel; along its
diagonal the error is at most 0.06.

Arguments of painters:
    image: part of the picture.
    win: (y0, y1, x0, x1, top, left), rows and columns to paint, and the position of the first pixel
        of `image` in the picture.
    cam: (pixel, cy, cx), side of a pixel, m, and row and column coordinate of the origin.

The value of a pixel depends only on its position in the picture: a part that is painted separately
equals the same part of the whole.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from scenarios.scenes.drawing.shading import Array, brightness

Win = tuple[int, int, int, int, int, int]
Cam = tuple[float, float, float]

BLOB_REACH = 3.5
"""Extent of a blob, standard deviations; it reaches zero there without a step."""


def grid(win: Win, cam: Cam) -> tuple[Array, Array]:
    """x (1, w) and y (h, 1) of the pixel centres of the window, m."""
    y0, y1, x0, x1, _, _ = win
    pixel, cy, cx = cam
    x = (np.arange(x0, x1, dtype=np.float64)[None, :] + (0.5 - cx)) * pixel
    y = (np.arange(y0, y1, dtype=np.float64)[:, None] + (0.5 - cy)) * pixel
    return x, y


def cover(d: Array) -> Array:
    """Share of a pixel inside an edge at the signed distance d, pixels (negative inside)."""
    return np.clip(0.5 - d, 0.0, 1.0)


def cover_solid(d: Array, r: Any) -> Array:
    """The same for a line or disc of half width r, pixels, which may be below a pixel: the
    difference of its two edges, exact for a line along the side of the pixel."""
    d = np.maximum(d, -r)
    return np.clip(d + 2 * r + 0.5, 0.0, 1.0) - np.clip(d + 0.5, 0.0, 1.0)


def lay(image: Any, win: Win, part: Array, tone: Any) -> None:
    """Covers the window: image + part (tone - image), with the tone clipped to [0, 1]."""
    y0, y1, x0, x1, top, left = win
    under = image[y0 - top : y1 - top, x0 - left : x1 - left]
    under += part * (np.clip(tone, 0.0, 1.0) - under)


class Ellipse(NamedTuple):
    """An ellipse with axes along x and y.

    Attributes:
        x, y: centre, m.
        a, b: semi-axes along x and y, m.
        tone: reflectance.
        lit: shading, from 0 for a flat shape to 1 for a half sphere.
        shine: height of the highlight.
    """

    x: float
    y: float
    a: float
    b: float
    tone: float
    lit: float
    shine: float


class Blob(NamedTuple):
    """A soft shadow or glow: the factor 1 + gain exp(-q / 2), q = (u / a)^2 + (v / b)^2.

    Attributes:
        x, y: centre, m.
        a, b: standard deviations along u and v, m.
        turn: clockwise rotation of its axes (u, v), rad.
        gain: change of brightness in the centre; below 0 for a shadow.
    """

    x: float
    y: float
    a: float
    b: float
    turn: float
    gain: float


def paint_all(image: Any, win: Win, cam: Cam, tone: float) -> None:
    """Paints one tone over the window."""
    lay(image, win, np.ones((1, 1)), tone)


def paint_ellipse(image: Any, win: Win, cam: Cam, shape: Ellipse) -> None:
    """Paints an ellipse. The distance is the first-order one, F / |grad F|, exact for circles."""
    x, y, a, b, tone, lit, shine = shape
    pixel = cam[0]
    u, v = grid(win, cam)
    u, v = u - x, v - y
    gx, gy = u / (a * a), v / (b * b)
    q = np.sqrt(u * gx + v * gy)
    slope = np.sqrt(gx * gx + gy * gy) + 1e-12
    d = np.where(q > 1e-9, (q - 1.0) * q / slope, -min(a, b))
    part = cover_solid(d / pixel, min(a, b) / pixel)
    light: Any = tone
    if lit > 0.0:
        light = brightness(gx / slope * q * lit, gy / slope * q * lit, tone, shine, 30.0)
    lay(image, win, part, light)


def paint_blob(image: Any, win: Win, cam: Cam, blob: Blob) -> None:
    """Multiplies by the factor of a blob. Values may exceed 1 until the whole picture is
    clipped."""
    y0, y1, x0, x1, top, left = win
    px, py = grid(win, cam)
    px, py = px - blob.x, py - blob.y
    cos, sin = math.cos(blob.turn), math.sin(blob.turn)
    u, v = cos * px + sin * py, cos * py - sin * px
    e = np.exp(-0.5 * ((u / blob.a) ** 2 + (v / blob.b) ** 2)) - math.exp(-0.5 * BLOB_REACH**2)
    under = image[y0 - top : y1 - top, x0 - left : x1 - left]
    under *= 1.0 + blob.gain * np.maximum(e, 0.0)
