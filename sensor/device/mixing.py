"""Compiled kernel of the cross-talk map (sensor/device/crosstalk.py)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from cosim.compute.cores import all_cores

__all__ = ["mix"]


@all_cores
@njit(cache=True, parallel=True)
def mix(plane, share, y0, x0, out):  # type: ignore[no-untyped-def]
    """Fills `out` with rows from y0 and columns from x0 of the plane's image: a step of the walk
    along columns, then one along rows. Sums of differences: uniform light stays the same to the
    last bit."""
    height, width = plane.shape
    for r in prange(out.shape[0]):
        y = y0 + r
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        columns = np.empty(out.shape[1] + 2, np.float32)
        for c in range(columns.size):
            x = min(max(x0 + c - 1, 0), width - 1)
            here = plane[y, x]
            columns[c] = here + share * ((plane[above, x] - here) + (plane[below, x] - here))
        for c in range(out.shape[1]):
            here = columns[c + 1]
            out[r, c] = here + share * ((columns[c] - here) + (columns[c + 2] - here))
