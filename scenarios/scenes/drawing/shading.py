"""Light and texture of the surfaces of analytic scenes.

Compiled by numba (some seconds at the first use, then cached). `noise`, `square_mean` and
`brightness` are for arrays. numba's `vectorize` would make them of the functions of one value, but
builds their loops anew in every process, 40 ms each.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]

# Lighting, all assumed: a large soft source at the upper left in front, a weak one at the right,
# and ambient light. A surface that faces the camera has the brightness 1.
KEY = (-0.50, -0.52, 0.69)
FILL = (0.80, 0.05, 0.60)
AMBIENT, KEY_PART, FILL_PART, WRAP = 0.15, 0.84, 0.13, 0.22
HALF = math.sqrt(KEY[0] ** 2 + KEY[1] ** 2 + (KEY[2] + 1) ** 2)
"""Length of the sum of the directions to the key light and to the camera."""

PLAIN, CHECK, HAIR, SKIN = range(4)
"""Patterns of a surface."""
ROW, COLUMN, SEED = 1, 2531, 619
"""Steps through the table from one lattice point to the next. 2531 is near 4096 over the golden
ratio: the nearest points with the same value are about 60 cells apart."""


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


def visible(cell: float, pixel: float) -> float:
    """Factor on the contrast of a texture with cells of this size: 0 below one pixel, where it
    would alias, 1 from two pixels on."""
    return min(max(cell / pixel - 1.0, 0.0), 1.0)


def lattice(i: Any, j: Any, seed: int) -> Array:
    """A fixed value in [0, 1) for each lattice point (i, j), int64 arrays."""
    return VALUES[(i * ROW + j * COLUMN + seed * SEED) & 0xFFF]


@njit(cache=True, error_model="numpy", nogil=True)
def _noise(x, y, seed):  # type: ignore[no-untyped-def]  # compiled for float64
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    u = u * u * u * (u * (u * 6 - 15) + 10)
    v = v * v * v * (v * (v * 6 - 15) + 10)
    n = int(i) * ROW + int(j) * COLUMN + seed * SEED
    a, b = VALUES[n & 0xFFF], VALUES[(n + ROW) & 0xFFF]
    c, d = VALUES[(n + COLUMN) & 0xFFF], VALUES[(n + (ROW + COLUMN)) & 0xFFF]
    top = a + u * (b - a)
    return top + v * (c + u * (d - c) - top)


@njit(cache=True, error_model="numpy", nogil=True)
def _slope(x, y, seed, axis):  # type: ignore[no-untyped-def]
    """Derivative of `_noise` along x (axis 0) or y (axis 1)."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    n = int(i) * ROW + int(j) * COLUMN + seed * SEED
    a, b = VALUES[n & 0xFFF], VALUES[(n + ROW) & 0xFFF]
    c, d = VALUES[(n + COLUMN) & 0xFFF], VALUES[(n + (ROW + COLUMN)) & 0xFFF]
    if axis == 1:
        u, v, b, c = v, u, c, b
    steep = 30 * u * u * (1 - u) * (1 - u)
    return steep * (b - a + v * v * v * (v * (v * 6 - 15) + 10) * (a - b - c + d))


@njit(cache=True, error_model="numpy", nogil=True)
def _square_mean(phase, width):  # type: ignore[no-untyped-def]
    a, b = phase - 0.5 * width, phase + 0.5 * width
    fa, fb = math.floor(a), math.floor(b)
    return (0.5 * (fb - fa) + min(b - fb, 0.5) - min(a - fa, 0.5)) / width


@njit(cache=True, error_model="numpy", nogil=True)
def _diffuse(tx, ty):  # type: ignore[no-untyped-def]
    """Brightness of a matt surface with the tilt (tx, ty) of its normal: Lambert, with the key
    light of a large source, which extends beyond the edge of the shadow."""
    t2 = tx * tx + ty * ty
    down = 1.0 / math.sqrt(max(t2, 1.0))
    tx, ty, tz = tx * down, ty * down, math.sqrt(max(1.0 - t2, 0.0))
    key = max(tx * KEY[0] + ty * KEY[1] + tz * KEY[2] + WRAP, 0.0) / (KEY[2] + WRAP)
    fill = max(tx * FILL[0] + ty * FILL[1] + tz * FILL[2], 0.0) / FILL[2]
    total = AMBIENT * (0.55 + 0.45 * tz) + KEY_PART * key + FILL_PART * fill
    return total / (AMBIENT + KEY_PART + FILL_PART)


@njit(cache=True, error_model="numpy", nogil=True)
def _highlight(tx, ty, shine, gloss):  # type: ignore[no-untyped-def]
    """Brightness of the highlight of a surface with the tilt (tx, ty) (Blinn-Phong, Blinn 1977)."""
    if shine <= 0.0:
        return 0.0
    t2 = tx * tx + ty * ty
    spot = tx * KEY[0] + ty * KEY[1] + math.sqrt(max(1.0 - t2, 0.0)) * (KEY[2] + 1)
    return shine * max(spot / math.sqrt(max(t2, 1.0)) / HALF, 0.0) ** gloss


# The loops below do little each, with few arrays, so that the compiler makes vector instructions of
# them.


@njit(cache=True, error_model="numpy", nogil=True)
def _part(d, r, pixel, out):  # type: ignore[no-untyped-def]
    """Coverage of pixels; see `cover_solid`. Distance and radius are in m."""
    for n in range(out.size):
        far, wide = d[n] / pixel, r[n] / pixel
        far = max(far, -wide)
        out[n] = min(max(far + 2 * wide + 0.5, 0.0), 1.0) - min(max(far + 0.5, 0.0), 1.0)


@njit(cache=True, error_model="numpy", nogil=True)
def _axes(x, y, s, cos, sin, u, v):  # type: ignore[no-untyped-def]
    """Places in the axes of the pattern, m."""
    for n in range(u.size):
        u[n] = cos * (x[n] - s.x) + sin * (y[n] - s.y)
        v[n] = cos * (y[n] - s.y) - sin * (x[n] - s.x)


@njit(cache=True, error_model="numpy", nogil=True)
def _emboss(tx, ty, x, y, bumps):  # type: ignore[no-untyped-def]
    """Tilts the normals by a relief; see `paint_body`."""
    for m in range(bumps.shape[0]):
        bx, by, sx, sy = bumps[m, 0], bumps[m, 1], bumps[m, 2], bumps[m, 3]
        for n in range(tx.size):
            ex, ey = (x[n] - bx) / sx, (y[n] - by) / sy
            g = bumps[m, 4] * math.exp(-0.5 * (ex * ex + ey * ey))
            tx[n] += g * ex / sx
            ty[n] += g * ey / sy


@njit(cache=True, error_model="numpy", nogil=True)
def _wrinkle(tx, ty, u, v, s, cos, sin):  # type: ignore[no-untyped-def]
    """Tilts the normals as wrinkled cloth does: by the gradient of noise whose cells are 2.2 times
    longer along v. Wrinkles shift the pattern of the cloth."""
    for n in range(tx.size):
        a, b = u[n] / s.fold_size, v[n] / (2.2 * s.fold_size)
        du, dv = s.folds * _slope(a, b, 3, 0), s.folds / 2.2 * _slope(a, b, 3, 1)
        u[n] += 0.30 * s.fold_size * du
        v[n] += 0.30 * s.fold_size * dv
        tx[n] += cos * du - sin * dv
        ty[n] += sin * du + cos * dv


@njit(cache=True, error_model="numpy", nogil=True)
def _print(tone, u, v, s, pixel, clear):  # type: ignore[no-untyped-def]
    """Multiplies the tone by the pattern at (u, v), m, in its axes. clear: `visible` of it."""
    p, w = s.period, pixel / s.period
    if s.pattern == CHECK:  # a twill check: broad bands both ways and a fine overcheck
        for n in range(tone.size):
            a = _square_mean(u[n] / p, w) + _square_mean(v[n] / p, w)
            fine = _square_mean(2 * u[n] / p + 0.2, 2 * w) + _square_mean(2 * v[n] / p + 0.2, 2 * w)
            tone[n] *= 1.0 + s.contrast * (a - 1.0 + 0.35 * (fine - 1.0))
    elif s.pattern == HAIR:  # strands run along v
        for n in range(tone.size):
            a = (_noise(u[n] / p, v[n] / (14 * p), 5) - 0.5) * clear
            a += _noise(u[n] / (4 * p), v[n] / (30 * p), 6) - 0.5
            tone[n] *= 1.0 + 2 * s.contrast * a
    elif s.pattern == SKIN:
        for n in range(tone.size):
            a = (_noise(u[n] / p, v[n] / p, 7) - 0.5) * clear
            a += _noise(u[n] / (9 * p), v[n] / (9 * p), 8) - 0.5
            tone[n] *= 1.0 + s.contrast * a


@njit(cache=True, error_model="numpy", nogil=True)
def _cover(flat, place, part, tone):  # type: ignore[no-untyped-def]
    """Covers parts of pixels with the tone, clipped to [0, 1]."""
    for n in range(place.size):
        under = flat[place[n]]
        flat[place[n]] = under + part[n] * (min(max(tone[n], 0.0), 1.0) - under)


@njit(cache=True, error_model="numpy", nogil=True)
def shade(flat, place, surface, pixel, clear, s, bumps):  # type: ignore[no-untyped-def]
    """Paints pixels of a solid over the image.

    Args:
        flat: (pixels,) float32, the image.
        place: (n,) int64, indices into it.
        surface: (6, n or more) float64: x, y, distance to the outline, tilt x, tilt y of the
            normal, and radius of the solid; m. The tilts are changed.
        pixel: side of a pixel, m.
        clear: `visible` of the pattern.
        s: Surface of floats alone.
        bumps: (m, 5) float64; see `paint_body`.
    """
    size = place.size
    x, y, d = surface[0][:size], surface[1][:size], surface[2][:size]
    tx, ty, r = surface[3][:size], surface[4][:size], surface[5][:size]
    # Rows of one array would not be known to be apart, and their loops not be vectorised.
    u, v, part, tone = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    cos, sin = math.cos(s.turn), math.sin(s.turn)
    _part(d, r, pixel, part)
    _axes(x, y, s, cos, sin, u, v)
    tx *= s.round
    ty *= s.round
    _emboss(tx, ty, x, y, bumps)
    if s.seam > -1e6:
        for n in range(size):
            part[n] *= min(max(0.5 - (s.seam - u[n]) / pixel, 0.0), 1.0)
    if s.folds > 0.0:
        _wrinkle(tx, ty, u, v, s, cos, sin)
    for n in range(size):
        tone[n] = s.albedo * _diffuse(tx[n], ty[n])
    _print(tone, u, v, s, pixel, clear)
    if s.shine > 0.0:
        for n in range(size):
            tone[n] += _highlight(tx[n], ty[n], s.shine, s.gloss)
    _cover(flat, place, part, tone)


@njit(cache=True, error_model="numpy", nogil=True)
def _noises(x, y, seed, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        out[n] = _noise(x[n], y[n], seed)


@njit(cache=True, error_model="numpy", nogil=True)
def _square_means(phase, width, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        out[n] = _square_mean(phase[n], width[n])


@njit(cache=True, error_model="numpy", nogil=True)
def _brightnesses(tx, ty, tone, shine, gloss, out):  # type: ignore[no-untyped-def]
    for n in range(out.size):
        out[n] = tone * _diffuse(tx[n], ty[n]) + _highlight(tx[n], ty[n], shine, gloss)


def _each(loop: Any, a: Any, b: Any, *rest: float) -> Array:
    """The values of a compiled loop over two arrays of float64 that broadcast."""
    one, two = (np.array(each) for each in np.broadcast_arrays(a, b))
    out = np.empty(one.shape)
    loop(one.reshape(-1), two.reshape(-1), *rest, out.reshape(-1))
    return out


def noise(x: Any, y: Any, seed: int) -> Array:
    """Value noise in [0, 1) with cells of size 1, twice differentiable (quintic fade of K. Perlin,
    Improving Noise, SIGGRAPH 2002)."""
    return _each(_noises, x, y, seed)


def square_mean(phase: Any, width: Any) -> Array:
    """Mean of a square wave, which is 1 in the first half of a cycle and 0 in the second, over
    `width` > 0 cycles around `phase`, cycles; exact for any width."""
    return _each(_square_means, phase, width)


def brightness(tx: Array, ty: Array, tone: float, shine: float, gloss: float) -> Array:
    """Brightness of a surface of reflectance `tone` and a highlight of height `shine` and exponent
    `gloss`, for the tilt (tx, ty) of its normal."""
    return _each(_brightnesses, tx, ty, tone, shine, gloss)
