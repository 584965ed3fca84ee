"""Compiled loops over pixels: the light of plates, their edges, their depth, where they go.

A plate is seen through its homography. In its own plane the outline is g(u, v) = 0, negative
inside; its distance in pixels is g / |grad g| to first order, with the gradient along x and y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from scenarios.scenes.objects.plate import Matrix, Plate

SEEN: Final = 0
"""Value in an occlusion mask: the pixel shows one surface, which is seen at the other instant."""
MIXED: Final = 128
"""Its centre is seen at the other instant, but the pixel, or its place there, is at an edge."""
HIDDEN: Final = 255
"""Its centre is covered at the other instant, or outside the picture."""
HERE: Final = 2**-0.5
"""Distance from an edge within which a pixel may show two surfaces, pixels: half its diagonal."""
THERE: Final = 3 * 2**-0.5
"""The same for the four pixels between which a value is interpolated: a diagonal more."""
_BEYOND: Final = 1e9
"""Distance of a point that is far from a plate, pixels."""
_MARGIN: Final = 4.0
"""Pixels around the box of a plate in which its edge is sought."""
_ROUND: Final = 1.5 * 2.0**52
"""Added and taken away, it rounds a float64 to a whole number."""
_PI: Final = (3.1415926218032837, 3.1786509424591713e-08, 1.2246467991473532e-16)
"""π in parts; products of the first two, of 26 bits, with a whole number below 2^26 are exact."""
_S: Final = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(11))
"""Series of the sine at 0. Up to π / 2, what is left out is below 2^-59."""

Mask = npt.NDArray[np.uint8]


class Tables(NamedTuple):
    """Plates as arrays, the farthest first.

    Attributes:
        bounded: (n,) bool, whether a plate has an outline.
        outlines: (n, 6): a, b, power, petals, petal, tone.
        corners: (n, 3, 4), homogeneous corners of the box around each in its own plane.
        waves: (n, k, 4): p, q, phase and share; a share is 0 where a plate has fewer waves.
    """

    bounded: npt.NDArray[np.bool_]
    outlines: Matrix
    corners: Matrix
    waves: Matrix


def tabulate(plates: Sequence[Plate]) -> Tables:
    """The tables of plates."""
    rows, corners = [], []
    waves = np.zeros((len(plates), max(len(plate.waves) for plate in plates), 4))
    for n, plate in enumerate(plates):
        rows.append((plate.a, plate.b, plate.power, plate.petals, plate.petal, plate.tone))
        a, b = (1 + plate.petal) * plate.a, (1 + plate.petal) * plate.b
        corners.append([[-a, a, a, -a], [-b, -b, b, b], [1.0, 1, 1, 1]])
        for k, wave in enumerate(plate.waves):
            waves[n, k] = wave.p, wave.q, wave.phase, wave.share
    bounded = np.array([plate.category is not None for plate in plates])
    return Tables(bounded, np.array(rows, np.float64), np.array(corners), waves)


@njit(cache=True, error_model="numpy", nogil=True)
def _outline(p, q, row):  # type: ignore[no-untyped-def]
    """g and its gradient along p = u / a and q = v / b. row: of `Tables.outlines`."""
    n, m, petal = row[2], row[3], row[4]
    if n == 2.0:
        r = math.sqrt(p * p + q * q) + 1e-12
        gp, gq = p / r, q / r
    else:
        ap, aq = abs(p) + 1e-12, abs(q) + 1e-12
        r = (ap**n + aq**n) ** (1.0 / n)
        gp = math.copysign((ap / r) ** (n - 1.0), p)
        gq = math.copysign((aq / r) ** (n - 1.0), q)
    if petal == 0.0:
        return r - 1.0, gp, gq
    # cos(m φ) and sin(m φ) are those of the power (cos φ + i sin φ)^m, without an angle.
    length = math.sqrt(p * p + q * q)
    c, s = (p / length, q / length) if length > 0.0 else (1.0, 0.0)
    cosine, sine = c, s
    for _ in range(int(m) - 1):
        cosine, sine = cosine * c - sine * s, cosine * s + sine * c
    rim = 1.0 + petal * cosine
    slope = r * petal * m * sine / (rim * rim)  # along the angle
    return r / rim - 1.0, gp / rim - slope * q / (r * r), gq / rim + slope * p / (r * r)


@njit(cache=True, error_model="numpy", nogil=True)
def _seen(x, y, h):  # type: ignore[no-untyped-def]
    """u, v, depth of the plate on the ray through the point (x, y). h: inverse homography."""
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    u = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w
    v = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
    return u, v, 1.0 / w


@njit(cache=True, error_model="numpy", nogil=True)
def _slopes(u, v, depth, h):  # type: ignore[no-untyped-def]
    """Changes of u and v with x and y, m a pixel, at the point that shows (u, v) at this depth."""
    ux, uy = (h[0, 0] - u * h[2, 0]) * depth, (h[0, 1] - u * h[2, 1]) * depth
    vx, vy = (h[1, 0] - v * h[2, 0]) * depth, (h[1, 1] - v * h[2, 1]) * depth
    return ux, uy, vx, vy


@njit(cache=True, error_model="numpy", nogil=True)
def _distance(u, v, depth, h, s):  # type: ignore[no-untyped-def]
    """Signed distance from the outline, pixels, negative inside, of the point of the picture that
    shows (u, v) at this depth."""
    ux, uy, vx, vy = _slopes(u, v, depth, h)
    g, gp, gq = _outline(u / s[0], v / s[1], s)
    gu, gv = gp / s[0], gq / s[1]
    gx, gy = gu * ux + gv * vx, gu * uy + gv * vy
    return g / (math.sqrt(gx * gx + gy * gy) + 1e-12)


@njit(cache=True, error_model="numpy", nogil=True)
def _side(u, v, depth, h, s, reach):  # type: ignore[no-untyped-def]
    """BEYOND where the distance surely exceeds `reach`, -BEYOND where it is surely below -reach,
    else 0. This saves the powers and angles of most pixels of a plate.

    With m = max(|p|, |q|), the norm is m to 2^(1/n) m, and each part of its gradient is at most 1;
    petals change both by factors.
    """
    a, b, petal = 1.0 / s[0], 1.0 / s[1], s[4]
    widest, steepest = 2.0 ** (1.0 / s[2]), 1.0 + petal * s[3] / (1.0 - petal)
    ux, uy, vx, vy = _slopes(u, v, depth, h)
    x, y = abs(ux) * a + abs(vx) * b, abs(uy) * a + abs(vy) * b
    band = 1.001 * reach * steepest / (1.0 - petal) * math.sqrt(x * x + y * y)
    m = max(abs(u) * a, abs(v) * b)
    outside = m / (1.0 + petal) - 1.0 > band
    inside = m * widest / (1.0 - petal) - 1.0 < -band
    return _BEYOND if outside else (-_BEYOND if inside else 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def _sine(x):  # type: ignore[no-untyped-def]
    """sin x for |x| < 10^8, within 2^-52. Without a call, a loop becomes vector instructions, and
    its bits are the same on all processors."""
    n = (x * (1.0 / math.pi) + _ROUND) - _ROUND
    r = ((x - n * _PI[0]) - n * _PI[1]) - n * _PI[2]
    half = 0.5 * n - ((0.5 * n + _ROUND) - _ROUND)  # 0, or a half for an odd n
    a = r * r
    b = a * a
    c = b * b
    # In pairs, which a processor computes at the same time.
    low = (_S[1] + a * _S[2]) + b * (_S[3] + a * _S[4])
    high = (_S[5] + a * _S[6]) + b * (_S[7] + a * _S[8])
    series = low + c * (high + c * (_S[9] + a * _S[10]))
    return (1.0 - 8.0 * half * half) * (r + r * (a * series))


# The loops below are over the pixels of a row, from 0: of these the compiler makes vector
# instructions.


@njit(cache=True, error_model="numpy", nogil=True)
def _rays(left, y, h, us, vs, depth):  # type: ignore[no-untyped-def]
    for j in range(us.size):
        us[j], vs[j], depth[j] = _seen(left + j + 0.5, y, h)


@njit(cache=True, error_model="numpy", nogil=True)
def _distances(us, vs, depth, h, s, reach, d):  # type: ignore[no-untyped-def]
    for j in range(us.size):
        d[j] = _side(us[j], vs[j], depth[j], h, s, reach)
    for j in range(us.size):
        if d[j] == 0.0:
            d[j] = _distance(us[j], vs[j], depth[j], h, s)


@njit(cache=True, error_model="numpy", nogil=True)
def _texture(us, vs, waves, tone):  # type: ignore[no-untyped-def]
    tone[:] = 1.0
    for k in range(waves.shape[0]):
        p, q, phase, share = waves[k, 0], waves[k, 1], waves[k, 2], waves[k, 3]
        for j in range(us.size):
            tone[j] += share * _sine(p * us[j] + q * vs[j] + phase)


@njit(cache=True, error_model="numpy", nogil=True)
def _lay(row, d, tone, albedo):  # type: ignore[no-untyped-def]
    for j in range(row.size):
        part = min(max(0.5 - d[j], 0.0), 1.0)
        row[j] += part * (albedo * tone[j] - row[j])


@njit(cache=True, error_model="numpy", nogil=True)
def _rows(size):  # type: ignore[no-untyped-def]
    """Space for the values of a row. Rows of one array would not be known to be apart."""
    return np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)


@njit(cache=True, error_model="numpy", nogil=True)
def _paint(image, boxes, inverses, bounded, outlines, waves):  # type: ignore[no-untyped-def]
    us, vs, depth, d, tone = _rows(image.shape[1])
    for n in range(boxes.shape[0]):
        h, s, left, size = inverses[n], outlines[n], boxes[n, 2], boxes[n, 3] - boxes[n, 2]
        for i in range(boxes[n, 0], boxes[n, 1]):
            first, stop = 0, size
            _rays(left, i + 0.5, h, us[:size], vs[:size], depth[:size])
            if bounded[n]:
                _distances(us[:size], vs[:size], depth[:size], h, s, 0.5, d[:size])
                first, stop = size, 0
                for j in range(size):
                    if d[j] < 0.5:
                        first, stop = min(first, j), j + 1
            else:
                d[:] = -_BEYOND
            if first < stop:
                _texture(us[first:stop], vs[first:stop], waves[n], tone[first:stop])
                _lay(image[i, left + first : left + stop], d[first:stop], tone[first:stop], s[5])


@njit(cache=True, error_model="numpy", nogil=True)
def _surfaces(boxes, inverses, outlines, labels, edge, depth):  # type: ignore[no-untyped-def]
    us, vs, away, d, _ = _rows(labels.shape[1])
    for n in range(1, boxes.shape[0]):
        h, s, left, size = inverses[n], outlines[n], boxes[n, 2], boxes[n, 3] - boxes[n, 2]
        for i in range(boxes[n, 0], boxes[n, 1]):
            _rays(left, i + 0.5, h, us[:size], vs[:size], away[:size])
            _distances(us[:size], vs[:size], away[:size], h, s, HERE, d[:size])
            for j in range(size):
                if d[j] <= 0.0:
                    labels[i, left + j] = n
                if d[j] <= -HERE:  # a plate hides the edges behind it
                    edge[i, left + j] = False
                elif d[j] < HERE:
                    edge[i, left + j] = True
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            depth[i, j] = _seen(j + 0.5, i + 0.5, inverses[labels[i, j]])[2]


@njit(cache=True, error_model="numpy", nogil=True)
def _flow(labels, edge, befores, afters, boxes, inverses, outlines, moved, occlusion):  # type: ignore[no-untyped-def]
    height, width = labels.shape
    for i in range(height):
        for j in range(width):
            own = labels[i, j]
            u, v, _ = _seen(j + 0.5, i + 0.5, befores[own])
            h = afters[own]
            w = h[2, 0] * u + h[2, 1] * v + h[2, 2]
            x = (h[0, 0] * u + h[0, 1] * v + h[0, 2]) / w
            y = (h[1, 0] * u + h[1, 1] * v + h[1, 2]) / w
            moved[i, j, 0], moved[i, j, 1] = x - (j + 0.5), y - (i + 0.5)
            hidden = x < 0.0 or x >= width or y < 0.0 or y >= height
            mixed = edge[i, j] or x < 0.5 or x > width - 0.5 or y < 0.5 or y > height - 0.5
            for n in range(max(own, 1), boxes.shape[0]):  # its own plate, and those before it
                d = _BEYOND
                if boxes[n, 0] <= y <= boxes[n, 1] and boxes[n, 2] <= x <= boxes[n, 3]:
                    u, v, away = _seen(x, y, inverses[n])
                    d = _side(u, v, away, inverses[n], outlines[n], THERE)
                    if d == 0.0:
                        d = _distance(u, v, away, inverses[n], outlines[n])
                if n == own:
                    mixed |= d > -THERE
                else:
                    hidden |= d <= 0.0
                    mixed |= d < THERE
            occlusion[i, j] = HIDDEN if hidden else (MIXED if mixed else SEEN)


def _boxes(
    tables: Tables, homographies: Matrix, shape: tuple[int, int], margin: float
) -> npt.NDArray[np.int64]:
    """Boxes of pixels (n, 4) that hold the plates and a margin, pixels, within the picture: y0, y1,
    x0, x1 of the corners, since a plane before the camera is seen with straight edges."""
    corners = homographies @ tables.corners
    found = np.empty((len(corners), 4), np.int64)
    for axis, side in enumerate(shape):
        along = corners[:, 1 - axis] / corners[:, 2]
        low, high = np.floor(along.min(1) - margin), np.ceil(along.max(1) + margin)
        found[:, 2 * axis] = np.where(tables.bounded, low.clip(0, side), 0)
        found[:, 2 * axis + 1] = np.where(tables.bounded, high.clip(0, side), side)
    return found


def _waves(tables: Tables, homographies: Matrix, h: Matrix, shape: tuple[int, int]) -> Matrix:
    """Waves of the textures, (n, k, 4): 2π p, 2π q, phase, and the share of the mean over a pixel:
    times sinc of the cycles along its sides. For a whole plate these are the cycles at its centre
    (at the middle of the picture for the background): depth changes them by a few percent over a
    plate, and the factor of the finest wave at 250 rows is 0.98. h: inverse homographies.
    """
    middle = shape[1] / 2, shape[0] / 2
    w = homographies[:, 2, 2]
    x, y = (np.where(tables.bounded, homographies[:, k, 2] / w, middle[k]) for k in (0, 1))
    w = h[:, 2, 0] * x + h[:, 2, 1] * y + h[:, 2, 2]
    p, q = tables.waves[..., 0], tables.waves[..., 1]
    found = tables.waves.copy()
    found[..., :2] *= 2 * math.pi
    u, v = ((h[:, k, 0] * x + h[:, k, 1] * y + h[:, k, 2]) / w for k in (0, 1))
    across, down = (
        np.sinc(
            p * ((h[:, 0, side] - u * h[:, 2, side]) * (1 / w))[:, None]
            + q * ((h[:, 1, side] - v * h[:, 2, side]) * (1 / w))[:, None]
        )
        for side in (0, 1)
    )
    found[..., 3] *= across * down
    return found


def paint(tables: Tables, homographies: Matrix, shape: tuple[int, int]) -> Any:
    """Reflectance, (H, W) float32, of plates that are painted one over the other. A pixel at an
    edge is covered in part, 0.5 less its distance in pixels. homographies: (n, 3, 3)."""
    image = np.zeros(shape, np.float32)
    inverses: Matrix = np.linalg.inv(homographies).astype(np.float64)
    boxes = _boxes(tables, homographies, shape, 1.0)
    waves = _waves(tables, homographies, inverses, shape)
    _paint(image, boxes, inverses, tables.bounded, tables.outlines, waves)
    return image


def surfaces(
    tables: Tables, homographies: Matrix, shape: tuple[int, int]
) -> tuple[Mask, npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Number of the plate that the centre of each pixel shows, (H, W) uint8, its depth, m, float32,
    and whether it is within HERE of an edge."""
    labels, edge = np.zeros(shape, np.uint8), np.zeros(shape, np.bool_)
    depth = np.empty(shape, np.float32)
    boxes = _boxes(tables, homographies, shape, _MARGIN)
    _surfaces(boxes, np.linalg.inv(homographies), tables.outlines, labels, edge, depth)
    return labels, depth, edge


def flow(
    tables: Tables, before: Matrix, after: Matrix, labels: Mask, edge: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.float32], Mask]:
    """Flow (H, W, 2) float32, pixels to the right and down, and occlusion (H, W) uint8, of surfaces
    between two homographies of the plates."""
    moved = np.empty((*labels.shape, 2), np.float32)
    occlusion = np.empty(labels.shape, np.uint8)
    boxes = _boxes(tables, after, labels.shape, _MARGIN).astype(np.float64)
    inverses = np.linalg.inv(np.stack([before, after]))
    _flow(
        labels, edge, inverses[0], after, boxes, inverses[1], tables.outlines, moved, occlusion
    )  # fmt: skip
    return moved, occlusion
