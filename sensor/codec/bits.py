"""Bits of spike words, and whole numbers as bits: Exp-Golomb codes and LEB128 bytes, compiled.

An Exp-Golomb code of order k writes v + 2^k, which has L binary digits, as L - 1 - k zeros, a one,
and the L - 1 low digits: short for small numbers, bounded for any. Bits fill bytes from the least
significant on.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_PLACE = np.zeros(32, np.int64)
for _n in range(32):
    _PLACE[(((1 << _n) * 0x077CB531) & 0xFFFFFFFF) >> 27] = _n


@njit(cache=True, nogil=True)
def lowest_bit(word):  # type: ignore[no-untyped-def]
    """Index of the lowest set bit of a non-zero word in an int64 (de Bruijn multiplication)."""
    return _PLACE[(((word & -word) * 0x077CB531) & 0xFFFFFFFF) >> 27]


@njit(cache=True, nogil=True)
def golomb_size(values, order, stride):  # type: ignore[no-untyped-def]
    """Bits of the Exp-Golomb codes of every `stride`th value."""
    total = 0
    for i in range(0, values.size, stride):
        u = (np.int64(values[i]) + (1 << order)) >> order
        length = 0
        while u > 1:
            u >>= 1
            length += 1
        total += 2 * length + 1 + order
    return total


@njit(cache=True, nogil=True)
def write_golomb(values, order, out):  # type: ignore[no-untyped-def]
    """Writes uint32 values into `out`, which must have room; returns the bytes written."""
    held, bits, at = np.uint64(0), 0, 0
    for i in range(values.size):
        u = np.uint64(values[i]) + (np.uint64(1) << np.uint64(order))
        length, rest = 0, u
        while rest > np.uint64(1):
            rest >>= np.uint64(1)
            length += 1
        bits += length - order  # zeros
        while bits >= 8:
            out[at] = held & np.uint64(255)
            held >>= np.uint64(8)
            at += 1
            bits -= 8
        low = u ^ (np.uint64(1) << np.uint64(length))
        held |= ((low << np.uint64(1)) | np.uint64(1)) << np.uint64(bits)
        bits += length + 1
        while bits >= 8:
            out[at] = held & np.uint64(255)
            held >>= np.uint64(8)
            at += 1
            bits -= 8
    if bits:
        out[at] = held & np.uint64(255)
        at += 1
    return at


@njit(cache=True, nogil=True)
def read_golomb(data, order, out):  # type: ignore[no-untyped-def]
    """Reads out.size values; whether `data` holds exactly them."""
    held, bits, at = np.uint64(0), 0, 0
    for i in range(out.size):
        zeros = 0
        while True:
            if bits == 0:
                if at == data.size:
                    return False
                held, bits, at = np.uint64(data[at]), 8, at + 1
            one = held & np.uint64(1)
            held >>= np.uint64(1)
            bits -= 1
            if one:
                break
            zeros += 1
            if zeros > 32:
                return False
        length = zeros + order
        while bits < length:
            if at == data.size:
                return False
            held |= np.uint64(data[at]) << np.uint64(bits)
            bits += 8
            at += 1
        low = held & ((np.uint64(1) << np.uint64(length)) - np.uint64(1))
        held >>= np.uint64(length)
        bits -= length
        value = low + (np.uint64(1) << np.uint64(length)) - (np.uint64(1) << np.uint64(order))
        if value > np.uint64(0xFFFFFFFF):
            return False
        out[i] = value
    return at == data.size and held == 0


@njit(cache=True, nogil=True)
def leb_size(values):  # type: ignore[no-untyped-def]
    """Bytes of the values in LEB128: seven bits a byte, the eighth is set if more follow."""
    total = values.size
    for i in range(values.size):
        v = np.int64(values[i]) >> 7
        while v:
            v >>= 7
            total += 1
    return total


@njit(cache=True, nogil=True)
def write_leb(values, out):  # type: ignore[no-untyped-def]
    """Writes uint32 values in LEB128 into `out`, which has room."""
    at = 0
    for i in range(values.size):
        v = np.int64(values[i])
        while v > 127:
            out[at] = v & 127 | 128
            v >>= 7
            at += 1
        out[at] = v
        at += 1


@njit(cache=True, nogil=True)
def read_leb(data, out):  # type: ignore[no-untyped-def]
    """Reads out.size values; whether `data` holds exactly them."""
    at = 0
    for i in range(out.size):
        value, shift = np.int64(0), 0
        while True:
            if at == data.size or shift > 28:
                return False
            byte = np.int64(data[at])
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                break
        if value > 0xFFFFFFFF:
            return False
        out[i] = value
    return at == data.size


@njit(cache=True, nogil=True)
def zigzag(value):  # type: ignore[no-untyped-def]
    """0, -1, 1, -2, ... as 0, 1, 2, 3, ..."""
    return 2 * value if value >= 0 else -2 * value - 1


@njit(cache=True, nogil=True)
def unzigzag(code):  # type: ignore[no-untyped-def]
    """The number of a `zigzag` code."""
    return -((code + 1) >> 1) if code & 1 else code >> 1
