"""Shapes of analytic scenes: their coverage of pixels, shading and patterns.

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
import numpy.typing as npt
from numba import vectorize

__all__ = [
    "BLOB_REACH", "CHECK", "HAIR", "PLAIN", "SKIN", "Array", "Blob", "Cam", "Ellipse", "Surface",
    "Win", "cover", "cover_solid", "diffuse", "grid", "highlight", "lattice", "lay", "noise",
    "paint_all", "paint_blob", "paint_ellipse", "pattern", "square_mean", "visible", "wrinkles",
]  # fmt: skip

Array = npt.NDArray[np.float64]
Win = tuple[int, int, int, int, int, int]
Cam = tuple[float, float, float]

# Lighting, all assumed: a large soft source at the upper left in front, a weak one at the right,
# and ambient light. A surface that faces the camera has the brightness 1.
KEY = (-0.50, -0.52, 0.69)
FILL = (0.80, 0.05, 0.60)
AMBIENT, KEY_PART, FILL_PART, WRAP = 0.15, 0.84, 0.13, 0.22

BLOB_REACH = 3.5
"""Extent of a blob, standard deviations; it reaches zero there without a step."""

PLAIN, CHECK, HAIR, SKIN = range(4)
"""Patterns of a surface."""


class Surface(NamedTuple):
    """Reflection of a shape.

    Attributes:
        albedo: reflectance.
        pattern: PLAIN, CHECK, HAIR or SKIN.
        period: period of the pattern, m.
        contrast: contrast of the pattern.
        x, y, turn: origin, m, and clockwise rotation, rad, of the pattern's axes (u, v), which move
            with the shape.
        folds, fold_size: slope and size, m, of the wrinkles of cloth.
        shine, gloss: height and exponent of the highlight.
        round: 1 for a solid, 0 for a flat shape.
        seam: largest u of the shape, m, such as the end of a sleeve at the shoulder.
    """

    albedo: float
    pattern: int = PLAIN
    period: float = 0.03
    contrast: float = 0.0
    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    folds: float = 0.0
    fold_size: float = 0.05
    shine: float = 0.0
    gloss: float = 20.0
    round: float = 1.0
    seam: float = -1e6


def _table() -> Array:
    """4096 fixed values in [0, 1): a 32-bit integer mix (the constants are those of C. Wellons'
    "prospector" search, triple32) of 0, 1, 2, ..."""
    h = np.arange(1 << 12, dtype=np.uint32)
    for shift, factor in ((17, 0xED5AD4BB), (11, 0xAC4C1B51), (15, 0x31848BAB)):
        h ^= h >> np.uint32(shift)
        h *= np.uint32(factor)
    h ^= h >> np.uint32(14)
    return h / float(1 << 32)


VALUES = _table()
ROW, COLUMN, SEED = 1, 2531, 619
"""Steps through the table from one lattice point to the next. 2531 is near 4096 over the golden
ratio: the nearest points with the same value are about 60 cells apart."""


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


def visible(cell: float, pixel: float) -> float:
    """Factor on the contrast of a texture with cells of this size: 0 below one pixel, where it
    would alias, 1 from two pixels on."""
    return min(max(cell / pixel - 1.0, 0.0), 1.0)


def lattice(i: Any, j: Any, seed: int) -> Array:
    """A fixed value in [0, 1) for each lattice point (i, j), int64 arrays."""
    return VALUES[(i * ROW + j * COLUMN + seed * SEED) & 0xFFF]


@vectorize(cache=True)
def noise(x, y, seed):  # type: ignore[no-untyped-def]  # a ufunc: arrays of any shape
    """Value noise in [0, 1) with cells of size 1, twice differentiable (quintic fade of K. Perlin,
    Improving Noise, SIGGRAPH 2002)."""
    i, j = np.floor(x), np.floor(y)
    u, v = x - i, y - j
    u = u * u * u * (u * (u * 6 - 15) + 10)
    v = v * v * v * (v * (v * 6 - 15) + 10)
    n = int(i) * ROW + int(j) * COLUMN + seed * SEED
    a, b = VALUES[n & 0xFFF], VALUES[(n + ROW) & 0xFFF]
    c, d = VALUES[(n + COLUMN) & 0xFFF], VALUES[(n + (ROW + COLUMN)) & 0xFFF]
    top = a + u * (b - a)
    return top + v * (c + u * (d - c) - top)


@vectorize(cache=True)
def square_mean(phase, width):  # type: ignore[no-untyped-def]  # a ufunc: arrays of any shape
    """Mean of a square wave, which is 1 in the first half of a cycle and 0 in the second, over
    `width` > 0 cycles around `phase`, cycles; exact for any width."""
    a, b = phase - 0.5 * width, phase + 0.5 * width
    fa, fb = np.floor(a), np.floor(b)
    return (0.5 * (fb - fa) + min(b - fb, 0.5) - min(a - fa, 0.5)) / width


def pattern(s: Surface, u: Array, v: Array, pixel: float) -> Any:
    """Factor on the albedo at (u, v), m, in the axes of the pattern."""
    w, p = pixel / s.period, s.period
    if s.pattern == CHECK:  # a twill check: broad bands both ways and a fine overcheck
        a = square_mean(u / p, w) + square_mean(v / p, w)
        fine = square_mean(2 * u / p + 0.2, 2 * w) + square_mean(2 * v / p + 0.2, 2 * w)
        return 1.0 + s.contrast * (a - 1.0 + 0.35 * (fine - 1.0))
    if s.pattern == HAIR:  # strands run along v
        a = (noise(u / p, v / (14 * p), 5) - 0.5) * visible(p, pixel)
        a += noise(u / (4 * p), v / (30 * p), 6) - 0.5
        return 1.0 + 2 * s.contrast * a
    if s.pattern == SKIN:
        a = (noise(u / p, v / p, 7) - 0.5) * visible(p, pixel)
        a += noise(u / (9 * p), v / (9 * p), 8) - 0.5
        return 1.0 + s.contrast * a
    return 1.0


@vectorize(cache=True)
def _slope(x, y, seed, axis):  # type: ignore[no-untyped-def]  # a ufunc: arrays of any shape
    """Derivative of `noise` along x (axis 0) or y (axis 1)."""
    i, j = np.floor(x), np.floor(y)
    u, v = x - i, y - j
    n = int(i) * ROW + int(j) * COLUMN + seed * SEED
    a, b = VALUES[n & 0xFFF], VALUES[(n + ROW) & 0xFFF]
    c, d = VALUES[(n + COLUMN) & 0xFFF], VALUES[(n + (ROW + COLUMN)) & 0xFFF]
    if axis == 1:
        u, v, b, c = v, u, c, b
    steep = 30 * u * u * (1 - u) * (1 - u)
    return steep * (b - a + v * v * v * (v * (v * 6 - 15) + 10) * (a - b - c + d))


def wrinkles(s: Surface, u: Array, v: Array) -> tuple[Array, Array]:
    """Tilt (along u, along v) of the normal of wrinkled cloth: the gradient of noise whose cells
    are 2.2 times longer along v."""
    x, y = u / s.fold_size, v / (2.2 * s.fold_size)
    return s.folds * _slope(x, y, 3, 0), s.folds / 2.2 * _slope(x, y, 3, 1)


@vectorize(cache=True)
def diffuse(tx, ty):  # type: ignore[no-untyped-def]  # a ufunc: arrays of any shape
    """Brightness of a matt surface with the tilt (tx, ty) of its normal: Lambert, with the key
    light of a large source, which extends beyond the edge of the shadow."""
    t2 = tx * tx + ty * ty
    down = 1.0 / math.sqrt(max(t2, 1.0))
    tx, ty, tz = tx * down, ty * down, math.sqrt(max(1.0 - t2, 0.0))
    key = max(tx * KEY[0] + ty * KEY[1] + tz * KEY[2] + WRAP, 0.0) / (KEY[2] + WRAP)
    fill = max(tx * FILL[0] + ty * FILL[1] + tz * FILL[2], 0.0) / FILL[2]
    total = AMBIENT * (0.55 + 0.45 * tz) + KEY_PART * key + FILL_PART * fill
    return total / (AMBIENT + KEY_PART + FILL_PART)


def highlight(tx: Array, ty: Array, shine: float, gloss: float) -> Any:
    """Brightness of the highlight of a surface with the tilt (tx, ty) (Blinn-Phong, Blinn 1977)."""
    if shine <= 0.0:
        return 0.0
    t2 = tx * tx + ty * ty
    half = math.sqrt(KEY[0] ** 2 + KEY[1] ** 2 + (KEY[2] + 1) ** 2)
    spot = tx * KEY[0] + ty * KEY[1] + np.sqrt(np.maximum(1.0 - t2, 0.0)) * (KEY[2] + 1)
    return shine * np.maximum(spot / np.sqrt(np.maximum(t2, 1.0)) / half, 0.0) ** gloss


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
    light, spot = 1.0, 0.0
    if lit > 0.0:
        tx, ty = gx / slope * q * lit, gy / slope * q * lit
        light, spot = diffuse(tx, ty), highlight(tx, ty, shine, 30.0)
    lay(image, win, part, tone * light + spot)


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
