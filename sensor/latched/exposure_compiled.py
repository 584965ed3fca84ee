"""The sums of `exposure`, compiled by numba: the same integers in one pass over the pixels.

If the light of a whole chip changes every cycle or two, numpy is limited by its passes over memory.
Without fast-math, LLVM neither reorders nor fuses operations, so each rounds as in numpy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sensor.latched.pixel.charge import LARGEST, ONE

_MOST = float(LARGEST)
_ONE = float(ONE)


@njit(cache=True, nogil=True)
def fix_level(charge, plane, box, per_cycle, gain, dark, patterned):  # type: ignore[no-untyped-def]
    """Computes the charge a cycle of a box of a steady plane.

    Args:
        charge: (rows, columns of the box) int64, Q24.40; an output.
        plane: (H, W) float32.
        box: y0, y1, x0, x1.
        per_cycle: electrons a cycle per unit of light.
        gain, dark: (H, W) float64 fixed pattern, used only if `patterned`.
        patterned: whether there is a fixed pattern.

    Returns:
        Whether all light in the box is 0 or more.
    """
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
def add_parts(charge, firsts, lasts, shares, parts, longer, box):  # type: ignore[no-untyped-def]
    """Adds the changes of pieces that meet in a cycle, within a box.

    Args:
        charge: (H, W) int64, the first level of the first piece; changed in place.
        firsts, lasts: levels at the begin and the end of each piece, tuples of (H, W) int64.
        shares: (pieces, rows of the box or 1) float64, share of the cycle.
        parts: position of the middle of that share in the piece, 0 to 1, of the same shape.
        longer: (rows of the box or 1,) float64, share by which the cycle of a row is longer.
        box: y0, y1, x0, x1.
    """
    y0, y1, x0, x1 = box
    total = np.empty(x1 - x0, np.float64)
    for y in range(y0, y1):
        row = y - y0 if shares.shape[1] > 1 else 0
        base = charge[y, x0:x1]
        for x in range(total.size):
            total[x] = base[x] * longer[row]
        for n in range(len(firsts)):
            share, part = shares[n, row], parts[n, row]
            first, last = firsts[n][y, x0:x1], lasts[n][y, x0:x1]
            if share > 0:
                for x in range(total.size):
                    change = first[x] - base[x] + (last[x] - first[x]) * part
                    total[x] += change * share
        for x in range(total.size):
            base[x] += np.int64(np.rint(total[x]))
