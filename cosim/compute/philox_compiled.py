"""Philox4x32-10 for loops that numba compiles (numpy's form is cosim/compute/philox.py)."""

from __future__ import annotations

import numpy as np
from numba import njit

_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


@njit(cache=True, nogil=True, inline="always")
def ten_rounds(c0, c1, c2, c3, k0, k1):  # type: ignore[no-untyped-def]
    """The four words of a counter and a key, uint64 below 2^32 each. It is inlined, so that loops
    over it are vectorised."""
    for _ in range(10):
        # The masks change nothing, but tell the compiler that 32-bit products suffice.
        p0 = np.uint64(0xD2511F53) * (c0 & _LOW)
        p1 = np.uint64(0xCD9E8D57) * (c2 & _LOW)
        c0, c1 = (p1 >> _32) ^ c1 ^ k0, p1 & _LOW
        c2, c3 = (p0 >> _32) ^ c3 ^ k1, p0 & _LOW
        k0 = (k0 + np.uint64(0x9E3779B9)) & _LOW
        k1 = (k1 + np.uint64(0xBB67AE85)) & _LOW
    return c0, c1, c2, c3


@njit(cache=True, nogil=True)
def random_words(pixel, index, draw, seed, stream):  # type: ignore[no-untyped-def]
    """The four words of counter (pixel, index high, index low, draw) and key (seed, stream). All
    arguments are uint64; all but `index` are below 2^32."""
    return ten_rounds(pixel, index >> _32, index & _LOW, draw, seed, stream)


@njit(cache=True, nogil=True)
def fill_words(counters, k0, k1, out):  # type: ignore[no-untyped-def]
    """Fills `out`, (4, n) uint32, with the words of the counters, (4, n) uint64, and the key
    (k0, k1)."""
    for n in range(out.shape[1]):
        words = ten_rounds(
            counters[0, n], counters[1, n], counters[2, n], counters[3, n], k0, k1
        )  # fmt: skip
        out[0, n], out[1, n], out[2, n], out[3, n] = words


@njit(cache=True, nogil=True)
def pick(index, w0, w1, w2, w3):  # type: ignore[no-untyped-def]
    """Word index mod 4 of four."""
    slot = index & 3
    return w0 if slot == 0 else w1 if slot == 1 else w2 if slot == 2 else w3


@njit(cache=True, nogil=True)
def word_at(pixel, index, draw, seed, stream):  # type: ignore[no-untyped-def]
    """Word index mod 4 of counter (pixel, index div 4, draw); see `random_words`. Four indices
    share a counter."""
    w0, w1, w2, w3 = random_words(pixel, index >> np.uint64(2), draw, seed, stream)
    return pick(index, w0, w1, w2, w3)
