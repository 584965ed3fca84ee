"""Random draws inside compiled loops: Philox words and the interval's law, for numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from sensor.pixel.interval import KNOTS, MANTISSA_BITS

__all__ = ["look_up", "random_words"]

_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


@njit(cache=True)
def random_words(pixel, index, draw, seed, stream):  # type: ignore[no-untyped-def]
    """The four words of Philox4x32-10 at counter (pixel, index high, index low, draw), key (seed,
    stream), as uint64."""
    c0, c1, c2, c3 = pixel, index >> _32, index & _LOW, draw
    k0, k1 = seed, stream
    for _ in range(10):
        p0 = np.uint64(0xD2511F53) * c0
        p1 = np.uint64(0xCD9E8D57) * c2
        c0, c1 = (p1 >> _32) ^ c1 ^ k0, p1 & _LOW
        c2, c3 = (p0 >> _32) ^ c3 ^ k1, p0 & _LOW
        k0 = (k0 + np.uint64(0x9E3779B9)) & _LOW
        k1 = (k1 + np.uint64(0xBB67AE85)) & _LOW
    return c0, c1, c2, c3


@njit(cache=True)
def look_up(table, word):  # type: ignore[no-untyped-def]
    """Threshold in Q24.40 of a word below 2^32 (the lookup of interval.py)."""
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
