"""Compiled loops over pixels: a plate's light, its distance, its depth.

A plate is seen through its homography. In its own plane the outline is g(u, v) = 0, negative
inside; its distance in pixels is g / |grad g| to first order, with the gradient along x and y.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from cosim import Box
from scenarios.scenes.objects.plate import Matrix, Plate

__all__ = ["NOWHERE", "edges", "locate", "paint", "window"]

NOWHERE = 1e9
"""Distance of a pixel from a plate that is not near it, pixels."""


@njit(cache=True, error_model="numpy", nogil=True)
def _outline(u, v, s):  # type: ignore[no-untyped-def]
    """g and its gradient along u and v. s: `_numbers` of the plate."""
    a, b, n, m, petal = s[0], s[1], s[2], s[3], s[4]
    p, q = u / a, v / b
    if n == 2.0:
        r = math.sqrt(p * p + q * q) + 1e-12
        gp, gq = p / r, q / r
    else:
        ap, aq = abs(p) + 1e-12, abs(q) + 1e-12
        r = (ap**n + aq**n) ** (1.0 / n)
        gp = math.copysign((ap / r) ** (n - 1.0), p)
        gq = math.copysign((aq / r) ** (n - 1.0), q)
    if petal == 0.0:
        return r - 1.0, gp / a, gq / b
    angle = math.atan2(q, p)
    rim = 1.0 + petal * math.cos(m * angle)
    slope = r * petal * m * math.sin(m * angle) / (rim * rim)  # along the angle
    gp, gq = gp / rim - slope * q / (r * r), gq / rim + slope * p / (r * r)
    return r / rim - 1.0, gp / a, gq / b


@njit(cache=True, error_model="numpy", nogil=True)
def _seen(x, y, h):  # type: ignore[no-untyped-def]
    """u, v, depth of the plate on the ray through the point (x, y). h: inverse homography."""
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    u = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w
    v = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
    return u, v, 1.0 / w


@njit(cache=True, error_model="numpy", nogil=True)
def _distance(x, y, h, s):  # type: ignore[no-untyped-def]
    """Signed distance of the point (x, y) from the outline, pixels, negative inside."""
    u, v, depth = _seen(x, y, h)
    g, gu, gv = _outline(u, v, s)
    ux, uy = (h[0, 0] - u * h[2, 0]) * depth, (h[0, 1] - u * h[2, 1]) * depth
    vx, vy = (h[1, 0] - v * h[2, 0]) * depth, (h[1, 1] - v * h[2, 1]) * depth
    gx, gy = gu * ux + gv * vx, gu * uy + gv * vy
    return g / (math.sqrt(gx * gx + gy * gy) + 1e-12)


@njit(cache=True, error_model="numpy", nogil=True)
def _paint(image, box, h, s, waves, bounded):  # type: ignore[no-untyped-def]
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            x, y = j + 0.5, i + 0.5
            part = 1.0
            if bounded:
                part = min(max(0.5 - _distance(x, y, h, s), 0.0), 1.0)
                if part == 0.0:
                    continue
            u, v, _ = _seen(x, y, h)
            tone = 1.0
            for k in range(waves.shape[0]):
                tone += waves[k, 3] * math.sin(waves[k, 0] * u + waves[k, 1] * v + waves[k, 2])
            image[i, j] += part * (s[5] * tone - image[i, j])


@njit(cache=True, error_model="numpy", nogil=True)
def _edges(x, y, h, s, out):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        out[n] = _distance(x[n], y[n], h, s)


@njit(cache=True, error_model="numpy", nogil=True)
def _locate(x, y, h, out):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        out[0, n], out[1, n], out[2, n] = _seen(x[n], y[n], h)


def _numbers(plate: Plate) -> Matrix:
    return np.array(
        [plate.a, plate.b, plate.power, plate.petals, plate.petal, plate.tone], np.float64
    )


def _waves(plate: Plate, h: Matrix, centre: Matrix) -> Matrix:
    """Waves of the texture as rows (2π p, 2π q, phase, share), the shares those of the mean over a
    pixel: times sinc of the cycles along its sides. For the whole plate these are the cycles at its
    centre (at the middle of the picture for the background): depth changes them by a few percent
    over a plate, and the factor of the finest wave at 250 rows is 0.98.
    """
    x, y = centre
    u, v, depth = _seen(x, y, h)
    ux, uy = (h[0, :2] - u * h[2, :2]) * depth
    vx, vy = (h[1, :2] - v * h[2, :2]) * depth
    rows = []
    for wave in plate.waves:
        mean = np.sinc(wave.p * ux + wave.q * vx) * np.sinc(wave.p * uy + wave.q * vy)
        rows.append(
            (2 * math.pi * wave.p, 2 * math.pi * wave.q, wave.phase, wave.share * float(mean))
        )
    return np.array(rows, np.float64).reshape(-1, 4)


def window(plate: Plate, homography: Matrix, shape: tuple[int, int], margin: float = 1.0) -> Box:
    """Box of pixels that holds the plate and a margin, pixels, within the picture: that of its
    corners, since a plane before the camera is seen with straight edges."""
    if plate.category is None:
        return 0, shape[0], 0, shape[1]
    a, b = (1 + plate.petal) * plate.a, (1 + plate.petal) * plate.b
    corners = homography @ np.array([[-a, a, a, -a], [-b, -b, b, b], [1.0, 1, 1, 1]])
    x, y = corners[0] / corners[2], corners[1] / corners[2]
    y0, y1 = math.floor(y.min() - margin), math.ceil(y.max() + margin)
    x0, x1 = math.floor(x.min() - margin), math.ceil(x.max() + margin)
    y0, y1 = (min(max(n, 0), shape[0]) for n in (y0, y1))
    x0, x1 = (min(max(n, 0), shape[1]) for n in (x0, x1))
    return y0, y1, x0, x1


def paint(image: Any, plate: Plate, homography: Matrix) -> None:
    """Paints a plate over the picture, (H, W) float32, in place. A pixel at the edge is covered in
    part, 0.5 less its distance in pixels."""
    height, width = image.shape
    inverse: Matrix = np.linalg.inv(homography).astype(np.float64)
    background = plate.category is None
    place = np.array([width / 2, height / 2, 1.0]) if background else homography[:, 2]
    centre: Matrix = place[:2] / place[2]
    box = np.array(window(plate, homography, image.shape), np.int64)
    waves = _waves(plate, inverse, centre)
    _paint(image, box, inverse, _numbers(plate), waves, not background)


def edges(plate: Plate, homography: Matrix, x: Matrix, y: Matrix) -> Matrix:
    """Signed distance of points from a plate's outline, pixels, negative inside; -NOWHERE for the
    background, which is everywhere."""
    if plate.category is None:
        return np.full(x.shape, -NOWHERE)
    out = np.empty(x.shape)
    _edges(x.ravel(), y.ravel(), np.linalg.inv(homography), _numbers(plate), out.reshape(-1))
    return out


def locate(homography: Matrix, x: Matrix, y: Matrix) -> Matrix:
    """(u, v, depth) of the plate's plane on the rays through points, (3, n), m."""
    out = np.empty((3, x.size))
    _locate(x.ravel(), y.ravel(), np.linalg.inv(homography), out)
    return out
