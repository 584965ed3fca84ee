"""Lateral spread of photoelectrons between cathode and silicon, applied to their means.

A photoelectron gives all of its charge to one pixel, and photoelectrons land independently. Poisson
counts therefore remain Poisson and independent (thinning and superposition), and spreading the
means is exact also for the noise. Not modelled: diffusion of charge between pixels in the silicon,
which would correlate neighbours.

Outside the given rows and columns the light of the outermost pixel continues. A frame that is
computed in bands therefore differs from a whole frame near the edges of the bands.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["halo", "landing"]

Values = npt.NDArray[np.float64]
_BLOCK = 2
"""Pixels along a side of the blocks that the halo is computed in: its disc is 28 pixels wide."""


@njit(cache=True, nogil=True)
def _landing(means, kernel, out):  # type: ignore[no-untyped-def]
    height, width = means.shape
    line = np.empty(width)
    for y in range(height):
        for x in range(width):
            line[x] = kernel[0] * means[y, x]
        for k in range(1, kernel.size):
            up, down = max(y - k, 0), min(y + k, height - 1)
            for x in range(width):
                line[x] += kernel[k] * (means[up, x] + means[down, x])
        for x in range(width):
            total = kernel[0] * line[x]
            for k in range(1, kernel.size):
                total += kernel[k] * (line[max(x - k, 0)] + line[min(x + k, width - 1)])
            out[y, x] = total


@njit(cache=True, nogil=True)
def _disc(means, half, out):  # type: ignore[no-untyped-def]
    """Half widths (pixels) of the rows of a disc, from the centre outward."""
    height, width = means.shape
    reach = half.size - 1
    side = half[0]
    padded = width + 2 * side + 1
    sums = np.zeros((height, padded))
    for y in range(height):
        total = 0.0
        for x in range(padded - 1):
            total += means[y, min(max(x - side, 0), width - 1)]
            sums[y, x + 1] = total
    count = 0
    for k in range(-reach, reach + 1):
        count += 2 * half[abs(k)] + 1
    for y in range(height):
        for x in range(width):
            out[y, x] = 0.0
        for k in range(-reach, reach + 1):
            row, w = sums[min(max(y + k, 0), height - 1)], half[abs(k)]
            for x in range(width):
                out[y, x] += row[x + side + w + 1] - row[x + side - w]
        for x in range(width):
            out[y, x] /= count


def landing(means: Values, kernel: Values) -> Values:
    """(rows, W) means, spread along both axes by a symmetric kernel that is given from its centre
    outward."""
    out = np.empty_like(means)
    _landing(np.ascontiguousarray(means), kernel, out)
    return out


def halo(means: Values, radius: float) -> Values:
    """(rows, W) means, spread uniformly over a disc, in blocks of 2 x 2 pixels. radius: pixels."""
    height, width = means.shape
    spare = ((0, -height % _BLOCK), (0, -width % _BLOCK))
    full = np.pad(means, spare, mode="edge") if any(n for _, n in spare) else means
    rows, columns = full.shape[0] // _BLOCK, full.shape[1] // _BLOCK
    blocks = full.reshape(rows, _BLOCK, columns, _BLOCK).mean(axis=(1, 3))
    size = radius / _BLOCK
    reach = int(size)
    half = np.array([int(math.sqrt(size**2 - k * k)) for k in range(reach + 1)], np.int64)
    out = np.empty_like(blocks)
    _disc(blocks, half, out)
    return out.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)[:height, :width]
