"""Compiled kernel of the cross-talk map (sensor/device/crosstalk.py)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def _walk(share, before, here, after):  # type: ignore[no-untyped-def]
    """What a pixel has after a step of the walk along one axis."""
    return here + share * ((before - here) + (after - here))


@njit(cache=True, nogil=True)
def mix(begin, stop, plane, share, y0, x0, out):  # type: ignore[no-untyped-def]
    """Fills the rows `begin` to `stop` of `out`, which has rows from y0 and columns from x0 of the
    plane's image: a step of the walk along columns, then one along rows. Sums of differences:
    uniform light stays the same to the last bit."""
    height, width = plane.shape
    count = out.shape[1]
    columns = np.empty(count + 2, np.float32)
    for r in range(begin, stop):
        y = y0 + r
        line, above, below = plane[y], plane[max(y - 1, 0)], plane[min(y + 1, height - 1)]
        for c, x in ((0, max(x0 - 1, 0)), (count + 1, min(x0 + count, width - 1))):
            columns[c] = _walk(share, above[x], line[x], below[x])
        # Slices of one length: the compiler vectorises these loops.
        line, above, below = line[x0:][:count], above[x0:][:count], below[x0:][:count]
        for c in range(count):
            columns[c + 1] = _walk(share, above[c], line[c], below[c])
        for c in range(count):
            out[r, c] = _walk(share, columns[c], columns[c + 1], columns[c + 2])
