"""The sums of `exposure`, compiled by numba: the same integers, one pass over the pixels.

For light that changes on a whole chip every cycle or two, where numpy's passes over memory and not
the arithmetic are what time goes into. Without fast-math LLVM neither reorders nor fuses, so every
operation rounds as numpy's does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sensor.latched.pixel.fixed_point import LARGEST, ONE

__all__ = ["add_parts", "fix_level"]

_MOST = float(LARGEST)
_ONE = float(ONE)


@njit(cache=True, nogil=True)
def fix_level(charge, plane, box, per_cycle, gain, dark, patterned):  # type: ignore[no-untyped-def]
    """Fills in the charge a cycle, int64, of a box of a steady plane (H, W) float32. gain, dark:
    (H, W) float64, looked at where `patterned`. Returns whether all light there is 0 or more."""
    y0, y1, x0, x1 = box
    wrong = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            lit = plane[y, x]
            wrong += not (lit >= 0)
            electrons = np.float64(lit) * per_cycle
            if patterned:
                electrons = electrons * gain[y, x] + dark[y, x]
                electrons = electrons if electrons > 0 else 0.0
            electrons = electrons if electrons < _MOST else _MOST
            charge[y - y0, x - x0] = np.int64(np.rint(electrons * _ONE))
    return wrong == 0


@njit(cache=True, nogil=True)
def add_parts(charge, firsts, lasts, shares, parts, box):  # type: ignore[no-untyped-def]
    """Adds the pieces that meet in a cycle within a box to `charge` (H, W) int64, which holds the
    level at which the first of them starts. firsts, lasts: tuples of the levels of each piece, (H,
    W) int64. shares, parts: (pieces, rows of the box or 1) float64, the share of the cycle and how
    far into the piece its middle lies."""
    y0, y1, x0, x1 = box
    total = np.empty(x1 - x0, np.float64)
    for y in range(y0, y1):
        row = y - y0 if shares.shape[1] > 1 else 0
        total[:] = 0.0
        base = charge[y, x0:x1]
        for n in range(len(firsts)):
            share, part = shares[n, row], parts[n, row]
            first, last = firsts[n][y, x0:x1], lasts[n][y, x0:x1]
            if share > 0:
                for x in range(total.size):
                    change = first[x] - base[x] + (last[x] - first[x]) * part
                    total[x] += change * share
        for x in range(total.size):
            base[x] += np.int64(np.rint(total[x]))
