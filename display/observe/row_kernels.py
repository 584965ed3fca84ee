"""Compiled row kernels: integration of images, binary planes, and reduced pictures.

Rows are distributed over threads by `cosim.compute.cores.by_rows`.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def _read(planes, pad, plane, down, y, lines):  # type: ignore[no-untyped-def]
    """Fills `lines` with the rows that contribute to row y of the images, as floats, with `pad`
    dark pixels on both sides of each."""
    height, width = planes.shape[1:]
    for m in range(len(plane)):
        row = y + down[m]
        begin = m * (width + 2 * pad) + pad
        line = lines[begin : begin + width]
        if 0 <= row < height:
            source = planes[plane[m], row]
            for x in range(width):
                line[x] = source[x]
        else:
            for x in range(width):
                line[x] = 0.0


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add(total, line, weight):  # type: ignore[no-untyped-def]
    """total += weight line."""
    for x in range(len(total)):
        total[x] += weight * line[x]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_eight(total, lines, place, weight, t):  # type: ignore[no-untyped-def]
    """Adds the taps t to t + 8 in one pass, with one store for eight multiplications. The slices
    show the compiler that all indices are valid; otherwise it would not vectorise the loop."""
    width = len(total)
    s0, s1, s2, s3 = place[t], place[t + 1], place[t + 2], place[t + 3]
    s4, s5, s6, s7 = place[t + 4], place[t + 5], place[t + 6], place[t + 7]
    r0, r1 = lines[s0 : s0 + width], lines[s1 : s1 + width]
    r2, r3 = lines[s2 : s2 + width], lines[s3 : s3 + width]
    r4, r5 = lines[s4 : s4 + width], lines[s5 : s5 + width]
    r6, r7 = lines[s6 : s6 + width], lines[s7 : s7 + width]
    w0, w1, w2, w3 = weight[t], weight[t + 1], weight[t + 2], weight[t + 3]
    w4, w5, w6, w7 = weight[t + 4], weight[t + 5], weight[t + 6], weight[t + 7]
    for x in range(width):
        total[x] += ((w0 * r0[x] + w1 * r1[x]) + (w2 * r2[x] + w3 * r3[x])) + (
            (w4 * r4[x] + w5 * r5[x]) + (w6 * r6[x] + w7 * r7[x])
        )


# A compiled kernel has separate arguments: unpacking a record of arrays would cost time in each
# call.
@njit(cache=True, nogil=True)
def add_images(first, stop, planes, pad, plane, down, begin, place, weight, images):  # type: ignore[no-untyped-def]
    """Adds light to the rows `first` to `stop` of images: images[i, y, x] += sum over the taps t of
    image i of weight[t] · planes[plane[m], y + down[m], x + s], dark outside.

    Args:
        planes: (n, H, W) float32 or uint8.
        plane, down: (lines,) int64, the rows that are read; each is converted to float once.
        begin: (images + 1,) int64, first tap of each image.
        place: (taps,) int64, m (W + 2 pad) + pad + s with |s| <= pad.
        weight: (taps,) float32.
        images: (images, H, W) float32.
    """
    width = planes.shape[2]
    lines = np.zeros(len(plane) * (width + 2 * pad), np.float32)
    total = np.empty(width, np.float32)
    for y in range(first, stop):
        _read(planes, pad, plane, down, y, lines)
        for i in range(len(images)):
            t, end = begin[i], begin[i + 1]
            if t == end:
                continue
            for x in range(width):
                total[x] = 0.0
            while t + 8 <= end:
                _add_eight(total, lines, place, weight, t)
                t += 8
            while t < end:
                _add(total, lines[place[t] : place[t] + width], weight[t])
                t += 1
            _add(images[i, y], total, np.float32(1.0))


@njit(cache=True, nogil=True)
def carry_errors(first, stop, before, after, scale, part, error, planes):  # type: ignore[no-untyped-def]
    """Fills the rows `first` to `stop` of binary planes, for light that changes linearly from
    `before` to `after`. Plane k samples it at the share part[k], times `scale`, limited to [0, 1].

    A pixel is on if the sum of its level and its carried error is at least one half. The difference
    is carried to the next plane.

    Args:
        before, after, error: (H, W) float32; `error` is updated.
        part: (n,) float32.
        planes: (n, H, W) uint8, output.
    """
    one, half, none = np.float32(1.0), np.float32(0.5), np.float32(0.0)
    for y in range(first, stop):
        begin, end, left = before[y], after[y], error[y]
        for k in range(len(planes)):
            share, out = part[k], planes[k, y]
            for x in range(len(left)):
                level = (begin[x] + (end[x] - begin[x]) * share) * scale
                level = level if level > none else none
                value = left[x] + (level if level < one else one)
                on = np.int32(value >= half)
                out[x] = np.uint8(on)
                left[x] = value - np.float32(on)


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_reduced(first, stop, planes, by, weights, images):  # type: ignore[no-untyped-def]
    """Adds weighted planes to the rows `first` to `stop` of images, as means over `by` x `by`
    pixels: images[i, y, x] += sum over planes k of weights[i, k] · mean of planes[k] in the square.

    Args:
        planes: (n, H, W) float32, float64 or uint8; incomplete squares at the right and at the
            bottom are ignored.
        weights: (images, n) float32; planes of weight 0 are not read.
        images: (images, H // by, W // by) float32.
    """
    scale = np.float32(1.0 / (by * by))
    total = np.empty(planes.shape[2], np.float32)
    for y in range(first, stop):
        for i in range(len(images)):
            for x in range(len(total)):
                total[x] = 0.0
            for k in range(len(planes)):
                weight = weights[i, k]
                if weight == 0.0:
                    continue
                for row in range(y * by, (y + 1) * by):
                    _add(total, planes[k, row], weight)
            out = images[i, y]
            for x in range(len(out)):
                square = np.float32(0.0)
                for b in range(by):
                    square += total[x * by + b]
                out[x] += square * scale
