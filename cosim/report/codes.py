"""Codes of levels by a table, in one compiled pass."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def look_up(levels, most, table, out):  # type: ignore[no-untyped-def]
    """out = table[round(most · clip(level, 0, 1))], halves to even.

    Args:
        levels: (n,) floats.
        most: highest index of the table, of the type of a level.
        table: (most + 1,) uint8.
        out: (n,) uint8.
    """
    none, one = most - most, most / most  # a literal would make a float32 a float64
    for n in range(len(levels)):
        level = levels[n] if levels[n] > none else none
        level = level if level < one else one
        out[n] = table[np.int64(np.rint(level * most))]
