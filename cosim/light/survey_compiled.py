"""Compiled kernels of the survey (survey.py)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def widen(plane, before, share, least, most, slope, moved):  # type: ignore[no-untyped-def]
    """Extends the range of each pixel by a plane of light, its slope by the change from the plane
    before, times a share, and adds the change to `moved`: (H, W) float32 each, contiguous."""
    for y in range(plane.shape[0]):
        for x in range(plane.shape[1]):
            level = plane[y, x]
            change = np.abs(level - before[y, x])
            least[y, x] = min(least[y, x], level)
            most[y, x] = max(most[y, x], level)
            moved[y, x] += change
            slope[y, x] = max(slope[y, x], change * share if change > 0 else np.float32(0))


@njit(cache=True, nogil=True)
def widen_by_frames(frames, table, shares, least, most, slope, moved):  # type: ignore[no-untyped-def]
    """Fills the ranges with those of frames that follow each other: `widen` for one after another,
    row by row, so that what a row has so far stays in the cache.

    Args:
        frames: (T, H, W) uint8 codes, or float32 light.
        table: (256,) float32, light of a code; for light (2,) float32, factors.
        shares: (T - 1,) float32, part of the change to the next frame that a cycle may have.
        least, most, slope, moved: (H, W) float32; outputs.
    """
    count, height, width = frames.shape
    lit, before = np.empty((1, width), np.float32), np.empty((1, width), np.float32)
    for y in range(height):
        _lit(frames[0, y], table, before)
        here = slice(y, y + 1)
        least[here], most[here] = before, before
        slope[here], moved[here] = 0.0, 0.0
        for n in range(1, count):
            _lit(frames[n, y], table, lit)
            widen(lit, before, shares[n - 1], least[here], most[here], slope[here], moved[here])
            lit, before = before, lit


@njit(cache=True, nogil=True)
def _lit(row, table, out):  # type: ignore[no-untyped-def]
    """Fills a row, (1, W), with the light of a row of a frame."""
    if table.size == 2:
        for x in range(row.size):
            out[0, x] = row[x] * table[0] * table[1]
    else:
        for x in range(row.size):
            out[0, x] = table[int(row[x])]


@njit(cache=True, nogil=True)
def most_of_tiles(plane, side, reach, out):  # type: ignore[no-untyped-def]
    """Fills `out` with the most of each tile and of the pixels around it.

    Args:
        plane: (H, W) float32.
        side: rows and columns of a tile.
        reach: pixels around a tile that count.
        out: (rows of tiles, columns of tiles) float32; the output.
    """
    height, width = plane.shape
    line = np.empty(width, np.float32)
    for row in range(out.shape[0]):
        first = max(row * side - reach, 0)
        line[:] = plane[first]
        for y in range(first + 1, min((row + 1) * side + reach, height)):
            here = plane[y]
            for x in range(width):
                line[x] = max(line[x], here[x])
        for column in range(out.shape[1]):
            most = line[max(column * side - reach, 0)]
            for x in range(max(column * side - reach, 0), min((column + 1) * side + reach, width)):
                most = max(most, line[x])
            out[row, column] = most
