"""Compiled kernels of the common drift (drift.py)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from cosim.compute.cores import all_cores


@njit(cache=True, nogil=True)
def gained(first, last, part, gain, out):  # type: ignore[no-untyped-def]
    """Fills `out` with a level between two, at least 0, times a gain: (pixels,) float32 each.
    part: position of the level, 0 to 1."""
    for n in range(out.size):
        out[n] = max(first[n] + (last[n] - first[n]) * part, np.float32(0)) * gain


@all_cores
@njit(cache=True, nogil=True, parallel=True)
def gained_on_all_cores(first, last, part, gain, out):  # type: ignore[no-untyped-def]
    """`gained` for many pixels."""
    for n in prange(out.size):
        out[n] = max(first[n] + (last[n] - first[n]) * part, np.float32(0)) * gain


@all_cores
@njit(cache=True, nogil=True, parallel=True)
def scaled_on_all_cores(plane, gain, out):  # type: ignore[no-untyped-def]
    """Fills `out` with a plane times a gain: (pixels,) float32 each, for many pixels."""
    for n in prange(out.size):
        out[n] = plane[n] * gain
