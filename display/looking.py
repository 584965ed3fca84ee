"""Planes of light added to images, each through a small kernel of shifts, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

__all__ = ["carry_errors", "look"]


@njit(cache=True, parallel=True, fastmath={"contract"})
def look(planes, pad, plane, down, begin, line, along, weight, images):  # type: ignore[no-untyped-def]
    """images[i, y, x] += sum over taps t of image i of weight[t] · planes[plane[m], y + down[m],
    x + along[t]] with m = line[t]; dark outside.

    planes: (n, H, W) float32 or uint8. plane, down: (lines,) int64, the rows that are read for a
    row of the images. begin: (images + 1,) int64, where each image's taps begin. line, along:
    (taps,) int64, |along| <= pad; eight taps go into one pass along a row. weight: (taps,) float32.
    images: (images, H, W) float32.
    """
    height, width = planes.shape[1:]
    count, lines = len(images), len(plane)
    wide = width + 2 * pad
    for y in prange(height):
        # Each row is read and made float once, however many images and taps look at it.
        rows = np.zeros((lines, wide), np.float32)
        for m in range(lines):
            if 0 <= y + down[m] < height:
                source, row = planes[plane[m], y + down[m]], rows[m, pad : pad + width]
                for x in range(width):
                    row[x] = source[x]
        total = np.empty(width, np.float32)
        for i in range(count):
            t, stop = begin[i], begin[i + 1]
            if t == stop:
                continue
            total[:] = 0.0
            while t + 8 <= stop:
                # Slices, so that the compiler knows every index to be within and vectorises.
                s0, s1 = pad + along[t], pad + along[t + 1]
                s2, s3 = pad + along[t + 2], pad + along[t + 3]
                s4, s5 = pad + along[t + 4], pad + along[t + 5]
                s6, s7 = pad + along[t + 6], pad + along[t + 7]
                r0, r1 = rows[line[t], s0 : s0 + width], rows[line[t + 1], s1 : s1 + width]
                r2, r3 = rows[line[t + 2], s2 : s2 + width], rows[line[t + 3], s3 : s3 + width]
                r4, r5 = rows[line[t + 4], s4 : s4 + width], rows[line[t + 5], s5 : s5 + width]
                r6, r7 = rows[line[t + 6], s6 : s6 + width], rows[line[t + 7], s7 : s7 + width]
                w0, w1, w2, w3 = weight[t], weight[t + 1], weight[t + 2], weight[t + 3]
                w4, w5, w6, w7 = weight[t + 4], weight[t + 5], weight[t + 6], weight[t + 7]
                for x in range(width):
                    total[x] += ((w0 * r0[x] + w1 * r1[x]) + (w2 * r2[x] + w3 * r3[x])) + (
                        (w4 * r4[x] + w5 * r5[x]) + (w6 * r6[x] + w7 * r7[x])
                    )
                t += 8
            while t < stop:
                s0, w0 = pad + along[t], weight[t]
                r0 = rows[line[t], s0 : s0 + width]
                for x in range(width):
                    total[x] += w0 * r0[x]
                t += 1
            out = images[i, y]
            for x in range(width):
                out[x] += total[x]


@njit(cache=True, parallel=True)
def carry_errors(first, last, scale, part, error, planes):  # type: ignore[no-untyped-def]
    """Binary planes of light that runs from `first` to `last`: plane k shows its level at share
    part[k] of the way, times `scale`, held to 0 to 1.

    A pixel is on where its level and the error left to it reach one half; what that is too much or
    too little goes on to the next plane. first, last, error: (H, W) float32; error is changed.
    part: (n,) float32. planes: (n, H, W) uint8, written.
    """
    n, height, width = planes.shape
    one, half, none = np.float32(1.0), np.float32(0.5), np.float32(0.0)
    for y in prange(height):
        for k in range(n):
            share = part[k]
            for x in range(width):
                level = (first[y, x] + (last[y, x] - first[y, x]) * share) * scale
                value = error[y, x] + min(max(level, none), one)
                on = value >= half
                planes[k, y, x] = on
                error[y, x] = value - one if on else value
