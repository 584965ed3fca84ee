"""Compiled kernels of the common drift (drift.py), for the pixels `begin` to `stop`.

Slices show the compiler that all indices are valid; otherwise it would not vectorise the loops.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def gained(begin, stop, first, last, part, gain, out):  # type: ignore[no-untyped-def]
    """Fills `out` with a level between two, at least 0, times a gain: (pixels,) float32 each.
    part: position of the level, 0 to 1."""
    first, last, out = first[begin:stop], last[begin:stop], out[begin:stop]
    for n in range(out.size):
        out[n] = max(first[n] + (last[n] - first[n]) * part, np.float32(0)) * gain


@njit(cache=True, nogil=True)
def scaled(begin, stop, plane, gain, out):  # type: ignore[no-untyped-def]
    """Fills `out` with a plane times a gain: (pixels,) float32 each."""
    plane, out = plane[begin:stop], out[begin:stop]
    for n in range(out.size):
        out[n] = plane[n] * gain
