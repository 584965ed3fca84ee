"""Row kernels: planes of light added to images, binary planes, and reduced pictures; compiled.

Rows are distributed over threads that run compiled functions without the interpreter's lock: with
numba's own threads (parallel=True) these took three times as long to compile.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit

__all__ = ["add_images", "by_rows", "carry_errors", "shrink"]


@cache
def _threads() -> tuple[int, ThreadPoolExecutor]:
    count = os.cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    return count, ThreadPoolExecutor(count, thread_name_prefix="rows")


def by_rows(function: Callable[..., None], rows: int, *given: Any) -> None:
    """function(first, stop, *given) for all rows, on all cores: rows must not touch each other."""
    count, pool = _threads()
    edges = [rows * k // count for k in range(count + 1)]
    jobs = [pool.submit(function, a, b, *given) for a, b in pairwise(edges)]
    for job in jobs:
        job.result()


@njit(cache=True, nogil=True)
def _read(planes, pad, plane, down, y, lines):  # type: ignore[no-untyped-def]
    """Writes the rows that row y of the images is made of, as floats, `pad` of dark around each."""
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
    """Adds taps t to t + 8 in one pass, one store for eight multiplications. Slices tell the
    compiler that every index is within, or it would not vectorise."""
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


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def add_images(first, stop, planes, pad, plane, down, begin, place, weight, images):  # type: ignore[no-untyped-def]
    """Rows `first` to `stop` of images: images[i, y, x] += sum over taps t of image i of weight[t]
    · planes[plane[m], y + down[m], x + s], dark outside.

    Args:
        planes: (n, H, W) float32 or uint8.
        plane, down: (lines,) int64, the rows that are read, made float once however many images and
            taps look at them.
        begin: (images + 1,) int64, where each image's taps begin.
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
    """Rows `first` to `stop` of binary planes of light that runs from `before` to `after`: plane k
    shows its level at share part[k] of the way, times `scale`, held to 0 to 1.

    A pixel is on where its level and the error left to it reach one half; what that is too much or
    too little goes on to the next plane.

    Args:
        before, after, error: (H, W) float32; error is changed.
        part: (n,) float32.
        planes: (n, H, W) uint8, written.
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


@njit(cache=True, nogil=True)
def shrink(first, stop, planes, by, small):  # type: ignore[no-untyped-def]
    """Rows `first` to `stop` of small[k, y, x], the mean of planes[k] over `by` x `by` pixels.

    Args:
        planes: (n, H, W) float32 or uint8; what does not fill a whole one at the right and below is
            left out.
        small: (n, H // by, W // by) float32.
    """
    scale = np.float32(1.0 / (by * by))
    for y in range(first, stop):
        for k in range(len(small)):
            out = small[k, y]
            for x in range(len(out)):
                out[x] = 0.0
            for a in range(by):
                row = planes[k, y * by + a]
                for b in range(by):
                    for x in range(len(out)):
                        out[x] += row[x * by + b]
            for x in range(len(out)):
                out[x] *= scale
