"""Rounded solids of analytic scenes: smooth unions of round cones with shading, and soft shadows.

The conventions are those of `shapes`. The search for distances and the shading are compiled by
numba (some seconds at the first use, then cached): far cones are skipped tile by tile, and numpy
would go through the pixels of a solid once for each operation.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numba import njit

from scenarios.scenes.drawing.shading import Array, Surface, shade, visible
from scenarios.scenes.drawing.shapes import Cam, Win

TILE = 8
"""Side of the tiles in which far cones are skipped, pixels; they are aligned to the picture."""
_PIXELS: Final = TILE * TILE


def capsules(rows: Any) -> Array:
    """Table of round cones for the painters.

    Args:
        rows: (ax, ay, bx, by, ra, rb), centres and radii of the two ends, m. A row is a disc if one
            end contains the other.

    Returns:
        (n, 9) float64: start x, y, unit vector x, y, length, radius at the start and at the end,
        sine and cosine of the angle of taper.
    """
    r = np.asarray(rows, dtype=np.float64).reshape(-1, 6)
    along = r[:, 2:4] - r[:, 0:2]
    length = np.hypot(along[:, 0], along[:, 1])
    ra, rb = r[:, 4], r[:, 5]
    disc = length <= np.abs(ra - rb) + 1e-9
    start = np.where((disc & (rb > ra))[:, None], r[:, 2:4], r[:, 0:2])
    ra = np.where(disc, np.maximum(ra, rb), ra)
    rb = np.where(disc, ra, rb)
    safe = np.where(disc, 1.0, length)
    sine = (ra - rb) / safe
    unit = np.where(disc[:, None], (1.0, 0.0), along / safe[:, None])
    length = np.where(disc, 0.0, length)
    return np.column_stack([start, unit, length, ra, rb, sine, np.sqrt(1.0 - sine * sine)])


def polyline(
    points: Sequence[tuple[float, float]], first: float, middle: float, last: float
) -> list[tuple[float, ...]]:
    """Rows of cones along points, m. The radius changes linearly from `first` to `middle`, at half
    of the points, and to `last`."""
    n = len(points) - 1
    radii = _radii(n + 1, first, middle, last)
    return [(*points[m], *points[m + 1], radii[m], radii[m + 1]) for m in range(n)]


@lru_cache(maxsize=32)
def _radii(n: int, first: float, middle: float, last: float) -> tuple[float, ...]:
    return tuple(np.interp(np.linspace(0, 2, n), (0, 1, 2), (first, middle, last)).tolist())


@njit(cache=True, error_model="numpy", nogil=True)
def _distance(x, y, cone):  # type: ignore[no-untyped-def]  # compiled for float64
    """Signed distance to a round cone, exact (after I. Quilez, "2D distance functions"). One root
    for the two round ends, so that a loop over pixels becomes vector instructions."""
    ax, ay, ux, uy, length, ra, rb, sine, cosine = cone
    px, py = x - ax, y - ay
    s, q = px * ux + py * uy, abs(py * ux - px * uy)
    k = cosine * s - sine * q
    beyond = s - length
    square = px * px + py * py if k <= 0.0 else beyond * beyond + q * q
    rounded = math.sqrt(square) - (ra if k <= 0.0 else rb)
    return cosine * q + sine * s - ra if k > 0.0 and k < cosine * length else rounded


# The loops below are over the pixels of a tile, without branches: their length is known, and the
# compiler makes vector instructions of them.


@njit(cache=True, error_model="numpy", nogil=True)
def _distances(xs, ys, cone, out):  # type: ignore[no-untyped-def]
    for p in range(_PIXELS):
        out[p] = _distance(xs[p], ys[p], cone)


@njit(cache=True, error_model="numpy", nogil=True)
def _meets(other, d, blend):  # type: ignore[no-untyped-def]
    """Whether a cone at the distances `other` changes the union in any pixel."""
    met = False
    for p in range(_PIXELS):
        met |= other[p] < d[p] + blend
    return met


@njit(cache=True, error_model="numpy", nogil=True)
def _joined(d, value, other, second, blend):  # type: ignore[no-untyped-def]
    """A value of the union at the distance d, with that of a second solid at the distance
    `other`."""
    h = max(blend - abs(d - other), 0.0) / blend
    w = 0.5 * h * h if d < other else 1.0 - 0.5 * h * h  # weight of the second
    joined = second if other <= d - blend else value + w * (second - value)
    return value if other >= d + blend else joined


@njit(cache=True, error_model="numpy", nogil=True)
def _tilts(xs, ys, cone, blend, other, d, tx, ty):  # type: ignore[no-untyped-def]
    """Joins the tilts of the normals of a round cone's solid, at the distances `other`, to those of
    the union, at the distances d."""
    ax, ay, ux, uy, length, ra, rb, sine, cosine = cone
    end = cosine * length
    for p in range(_PIXELS):
        px, py = xs[p] - ax, ys[p] - ay
        s, n = px * ux + py * uy, py * ux - px * uy
        k = cosine * s - sine * abs(n)
        r = ra if k <= 0.0 else (rb if k >= end else ra + (rb - ra) * k / end)
        side = cosine if n > 0.0 else -cosine
        lean = max(1.0 + other[p] / r, 0.0)
        ex, ey = (px, py) if k <= 0.0 else (px - length * ux, py - length * uy)
        flank = k > 0.0 and k < end
        x = (sine * ux - side * uy) * lean if flank else ex / r
        y = (sine * uy + side * ux) * lean if flank else ey / r
        tx[p] = _joined(d[p], tx[p], other[p], x, blend)
        ty[p] = _joined(d[p], ty[p], other[p], y, blend)


@njit(cache=True, error_model="numpy", nogil=True)
def _join(xs, ys, cone, blend, other, d, r):  # type: ignore[no-untyped-def]
    """Joins a round cone's solid, at the distances `other`, to the union: distances and radii."""
    ax, ay, ux, uy, length, ra, rb, sine, cosine = cone
    end = cosine * length
    for p in range(_PIXELS):
        px, py = xs[p] - ax, ys[p] - ay
        k = cosine * (px * ux + py * uy) - sine * abs(py * ux - px * uy)
        radius = ra if k <= 0.0 else (rb if k >= end else ra + (rb - ra) * k / end)
        r[p] = _joined(d[p], r[p], other[p], radius, blend)
        h = max(blend - abs(d[p] - other[p]), 0.0) / blend
        least = min(d[p], other[p]) - 0.25 * h * h * blend
        joined = other[p] if other[p] <= d[p] - blend else least
        d[p] = d[p] if other[p] >= d[p] + blend else joined


@njit(cache=True, error_model="numpy", nogil=True)
def _search(parts, win, cam, blend, reach, tilted, across, place, surface):  # type: ignore[no-untyped-def]
    """Finds the pixels of the window within `reach`, m, of the union of the cones, which are joined
    smoothly over `blend`, m (polynomial smooth minimum, I. Quilez).

    Fills `place` (n,) with their indices into the image, which is `across` pixels wide, and
    `surface` (6, n) with x, y, distance, tilt x, tilt y (0 unless `tilted`) and radius. Returns
    their count. A cone is skipped in a tile if its distance from the tile's centre exceeds that of
    the nearest cone by the tile's diagonal and two blends: it cannot change the union there. Cones
    are passed as scalars: reference counting of table rows would take twice as long as the
    geometry.
    """
    y0, y1, x0, x1, dy, dx = win
    pixel, cy, cx = cam
    near, chosen = np.empty(parts.shape[0]), np.empty(parts.shape[0], np.int64)
    # Rows of one array would not be known to be apart, and their loops not be vectorised.
    xs, ys, other, d = np.empty(_PIXELS), np.empty(_PIXELS), np.empty(_PIXELS), np.empty(_PIXELS)
    tx, ty, r = np.zeros(_PIXELS), np.zeros(_PIXELS), np.empty(_PIXELS)
    half = 0.7072 * TILE * pixel
    n = 0
    for top in range(y0 // TILE * TILE, y1, TILE):
        for left in range(x0 // TILE * TILE, x1, TILE):
            x, y = (left + 0.5 * TILE - cx) * pixel, (top + 0.5 * TILE - cy) * pixel
            low = 1e30
            for m in range(parts.shape[0]):
                cone = (
                    parts[m, 0], parts[m, 1], parts[m, 2], parts[m, 3], parts[m, 4],
                    parts[m, 5], parts[m, 6], parts[m, 7], parts[m, 8],
                )  # fmt: skip
                near[m] = _distance(x, y, cone)
                low = min(low, near[m])
            if low - half - blend > reach:
                continue
            count = 0
            for m in range(parts.shape[0]):
                if near[m] <= low + 2 * (half + blend):
                    chosen[count] = m
                    count += 1
            for p in range(_PIXELS):
                xs[p] = (left + p % TILE + 0.5 - cx) * pixel
                ys[p] = (top + p // TILE + 0.5 - cy) * pixel
            d[:], r[:] = 1e30, 0.0
            if tilted:
                tx[:], ty[:] = 0.0, 0.0
            for m in range(count):
                k = chosen[m]
                cone = (
                    parts[k, 0], parts[k, 1], parts[k, 2], parts[k, 3], parts[k, 4],
                    parts[k, 5], parts[k, 6], parts[k, 7], parts[k, 8],
                )  # fmt: skip
                _distances(xs, ys, cone, other)
                if _meets(other, d, blend):
                    if tilted:
                        _tilts(xs, ys, cone, blend, other, d, tx, ty)
                    _join(xs, ys, cone, blend, other, d, r)
            for i in range(max(top, y0), min(top + TILE, y1)):
                for j in range(max(left, x0), min(left + TILE, x1)):
                    p = (i - top) * TILE + j - left
                    if d[p] < reach:
                        place[n] = (i - dy) * across + j - dx
                        surface[0, n], surface[1, n], surface[2, n] = xs[p], ys[p], d[p]
                        surface[3, n], surface[4, n], surface[5, n] = tx[p], ty[p], r[p]
                        n += 1
    return n


class _Room(threading.local):
    """Memory of a thread for what `_search` finds. New memory for each solid would cost a third of
    the search, in page faults."""

    def __init__(self) -> None:
        self._place, self._surface = np.empty(0, np.int64), np.empty(0)

    def of(self, size: int) -> tuple[Any, Array]:
        """Arrays (size,) int64 and (6, size) float64, valid until the next call."""
        if size > self._place.size:
            self._place, self._surface = np.empty(size, np.int64), np.empty(6 * size)
        return self._place[:size], self._surface[: 6 * size].reshape(6, size)


_ROOM = _Room()


def _find(
    image: Any, win: Win, cam: Cam, parts: Array, blend: float, reach: float, tilted: bool
) -> tuple[Any, Any, Array]:
    """The flat image, and the result of `_search`: indices into it, and rows x, y, distance, tilt
    x, tilt y, radius, which have room for more. They are valid until the next call of a thread."""
    place, surface = _ROOM.of((win[1] - win[0]) * (win[3] - win[2]))
    n = _search(parts, win, cam, blend, reach, tilted, image.shape[1], place, surface)
    return image.reshape(-1, copy=False), place[:n], surface


@njit(cache=True, error_model="numpy", nogil=True)
def _dim(flat, place, surface, wide, depth):  # type: ignore[no-untyped-def]
    """Darkens pixels of the flat image, for the distances and radii that `_search` found."""
    for n in range(place.size):
        a = min(max(0.5 - 0.5 * surface[2, n] / wide, 0.0), 1.0)
        r = min(surface[5, n] / wide, 1.0)
        flat[place[n]] *= 1.0 - depth * min(a * a * (3 - 2 * a) * 4 * r / (1 + r) ** 2, 1.0)


def paint_body(
    image: Any, win: Win, cam: Cam, parts: Array, blend: float, s: Surface, bumps: Array
) -> None:
    """Paints a shaded solid of cones over the image.

    Args:
        image, win, cam: see `shapes`.
        parts: table of `capsules`.
        blend: length over which cones are joined, m.
        s: reflection of the surface.
        bumps: relief, (m, 5) float64: x, y, radius x, radius y, height, m. It tilts the normal and
            does not change the outline.
    """
    pixel = cam[0]
    flat, place, found = _find(image, win, cam, parts, blend, 0.5 * pixel, True)
    floats: Any = map(float, s)  # one type of each field, for which `shade` is compiled
    shade(flat, place, found, pixel, visible(s.period, pixel), Surface(*floats), bumps)


def paint_shadow(
    image: Any, win: Win, cam: Cam, parts: Array, blend: float, soft: float, depth: float
) -> None:
    """Multiplies the image by 1 - depth inside the union of the cones. The edge has the half width
    `soft`, m, and at least half a pixel. The shadow of a thin object is fainter, nearly in
    proportion to its width."""
    wide = math.hypot(soft, 0.5 * cam[0])
    flat, place, found = _find(image, win, cam, parts, blend, wide, False)
    _dim(flat, place, found, wide, depth)
