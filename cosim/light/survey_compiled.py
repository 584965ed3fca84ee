"""Compiled kernel of the survey (survey.py)."""

from __future__ import annotations

import numpy as np
from numba import njit

__all__ = ["widen"]


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
