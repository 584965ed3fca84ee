"""Compiled kernel of the common drift (drift.py)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def gained(begin, stop, first, last, part, gain, out):  # type: ignore[no-untyped-def]
    """Fills the pixels `begin` to `stop` of `out` with a level between two, at least 0, times a
    gain: (pixels,) float32 each. part: position of the level, 0 to 1."""
    # Slices show the compiler that all indices are valid; otherwise the loop is not vectorised.
    first, last, out = first[begin:stop], last[begin:stop], out[begin:stop]
    for n in range(out.size):
        out[n] = max(first[n] + (last[n] - first[n]) * part, np.float32(0)) * gain
