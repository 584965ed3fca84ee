"""Lookup of thresholds within compiled loops, for numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from sensor.latched.pixel.interval import KNOTS, MANTISSA_BITS

__all__ = ["look_up"]


@njit(cache=True, nogil=True)
def look_up(table, word):  # type: ignore[no-untyped-def]
    """Threshold in Q24.40 of a random word below 2^32: `interval.threshold` for one word."""
    word = np.int64(word)
    base, y = np.int64(0), word
    if word >> 31:
        base, y = np.int64(KNOTS), word ^ np.int64(0xFFFFFFFF)
    exponent = np.int64(0)
    while (y >> exponent) >= 2 << MANTISSA_BITS:
        exponent += 1
    mantissa = y >> exponent
    index = base + (exponent << MANTISSA_BITS) + mantissa
    fraction = ((y - (mantissa << exponent)) << 16) >> exponent
    low = table[index]
    return low + (((table[min(index + 1, table.size - 1)] - low) * fraction) >> 16)
