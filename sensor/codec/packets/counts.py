"""The spikes that each pixel has in a packet, coarse to fine, compiled.

A pyramid of sums: blocks of 8 x 8 pixels, then 4 x 4, 2 x 2 and pixels. The blocks of 8 are
expected from those to the left and above (the median of the two and of their plane: Weinberger,
Seroussi and Sapiro 2000, equation 1). Every finer sum is a part of a sum that is known: left of
the whole, then the upper of either half. It is expected to be the share of its area, less the
gradient between the blocks on both sides.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.codec.packets.ranges import NUMBER, get_number, open_bits, put_number

TOP = 3
"""Level of the coarsest sums, blocks of 2^3 x 2^3 pixels."""
_ACTIVITY = 12
SUM_CONTEXTS = 4 * _ACTIVITY * NUMBER
MOST_PART = 48
"""Decisions of a part, at most: those of a number of 20 bits with a sign."""
SCALE = 1 << 16
"""Unit of gains."""
Sums = npt.NDArray[np.int32]


def pyramid(counts: Sums) -> list[Sums]:
    """Sums of blocks of 1, 2, 4 and 8 pixels of (h, w) counts; those at the border are cut."""
    levels = [counts]
    for _ in range(TOP):
        levels.append(_paired(levels[-1]))
    return levels


@njit(cache=True, nogil=True)
def _paired(below):  # type: ignore[no-untyped-def]
    """Sums of 2 x 2 blocks."""
    sums = np.zeros(((below.shape[0] + 1) >> 1, (below.shape[1] + 1) >> 1), np.int32)
    for y in range(below.shape[0]):
        for x in range(below.shape[1]):
            sums[y >> 1, x >> 1] += below[y, x]
    return sums


@njit(cache=True, nogil=True, inline="always")
def _length(value):  # type: ignore[no-untyped-def]
    """Binary digits of a number, at most _ACTIVITY - 1."""
    n = 0
    while value and n < _ACTIVITY - 1:
        value >>= 1
        n += 1
    return n


@njit(cache=True, nogil=True)
def _extent(place, level, size):  # type: ignore[no-untyped-def]
    """Pixels along one side of block `place`, of `size` in all; 0 beyond them."""
    return max(min((place + 1) << level, size) - (place << level), 0)


@njit(cache=True, nogil=True)
def _block(sums, y, x, height, width, cycles):  # type: ignore[no-untyped-def]
    """(expectation, contexts, most) of block (y, x) of the coarsest sums."""
    area = _extent(y, TOP, height) * _extent(x, TOP, width)
    full = 1 << 2 * TOP
    left = above = corner = 0
    if x:
        left = sums[y, x - 1] * full // (_extent(y, TOP, height) << TOP)
    if y:
        above = sums[y - 1, x] * full // (_extent(x, TOP, width) << TOP)
    if x and y:
        corner = sums[y - 1, x - 1]
        low, high = min(left, above), max(left, above)
        guess = min(max(left + above - corner, low), high)
        activity = _length((abs(left - corner) + abs(above - corner)) >> 2)
    else:
        guess, activity = left + above, _ACTIVITY - 1
    return guess * area // full, activity * NUMBER, area * cycles


@njit(cache=True, nogil=True)
def put_blocks(sums, height, width, cycles, decisions):  # type: ignore[no-untyped-def]
    """Decisions of the coarsest sums of height x width pixels; their number."""
    out, m = np.int64(decisions.ctypes.data), 0
    for y in range(sums.shape[0]):
        for x in range(sums.shape[1]):
            guess, context, _ = _block(sums, y, x, height, width, cycles)
            m = put_number(out, m, context, np.int64(sums[y, x]) - guess)
    return m


@njit(cache=True, nogil=True)
def get_blocks(words, model, height, width, cycles, sums):  # type: ignore[no-untyped-def]
    """Fills in the coarsest sums; whether they can be."""
    code, span, at = open_bits(words)
    data, states = np.int64(words.ctypes.data), np.int64(model.ctypes.data)
    for y in range(sums.shape[0]):
        for x in range(sums.shape[1]):
            guess, context, most = _block(sums, y, x, height, width, cycles)
            d, code, span, at = get_number(data, words.size, states, context, code, span, at)
            if guess + d < 0 or guess + d > most:
                return False
            sums[y, x] = guess + d
    return True


@njit(cache=True, nogil=True)
def _around(sums, y, x, dy, dx):  # type: ignore[no-untyped-def]
    """Sums on both sides of a block, its own where there is none."""
    own = np.int64(sums[y, x])
    before, after = own, own
    if y >= dy and x >= dx:
        before = np.int64(sums[y - dy, x - dx])
    if y + dy < sums.shape[0] and x + dx < sums.shape[1]:
        after = np.int64(sums[y + dy, x + dx])
    return before, after


@njit(cache=True, nogil=True)
def _part(sums, parts, y, x, step, level, height, width, cycles):  # type: ignore[no-untyped-def]
    """(whole, area of the part, area of the rest, expectation, contexts, least, most) of the left
    half of block (y, x) (step 0), or of the upper part of its left or right half (1, 2)."""
    upper = _extent(2 * y, level - 1, height)
    lower = _extent(2 * y + 1, level - 1, height)
    left, right = _extent(2 * x, level - 1, width), _extent(2 * x + 1, level - 1, width)
    block = np.int64(sums[y, x])
    if step == 0:
        high = upper + lower
        whole, one, other, damp, first = block, left * high, right * high, 4, 0
        before, after = _around(sums, y, x, 0, 1)
    else:
        wide = left if step == 1 else right
        whole, one, other, damp, first = np.int64(0), wide * upper, wide * lower, 5, 1
        if wide:
            whole = np.int64(parts[2 * y, 2 * x + step - 1])
            if lower:
                whole += np.int64(parts[2 * y + 1, 2 * x + step - 1])
        before, after = _around(sums, y, x, 1, 0)
    if not one or not other:
        return whole, one, other, whole if one else 0, 0, 0, 0
    slope = after - before
    guess = whole * one // (one + other) - ((slope + (1 << (damp - 1))) >> damp)
    least, most = max(whole - other * cycles, 0), min(whole, one * cycles)
    activity = _length(abs(after - block) + abs(block - before))
    context = (_ACTIVITY * (1 + first) + activity) * NUMBER
    return whole, one, other, min(max(guess, least), most), context, least, most


@njit(cache=True, nogil=True)
def put_parts(sums, parts, level, height, width, cycles, decisions, m):  # type: ignore[no-untyped-def]
    """Appends the decisions of the sums one level below `level`; (their number, gain).

    The gain is the sum over pixels of the squared error of their counts that these sums remove,
    times SCALE.
    """
    out, gain = np.int64(decisions.ctypes.data), 0
    for y in range(sums.shape[0]):
        for x in range(sums.shape[1]):
            for step in range(3):
                total, one, other, guess, context, least, most = _part(
                    sums, parts, y, x, step, level, height, width, cycles
                )
                if least < most:
                    part = np.int64(parts[2 * y, 2 * x + (step == 2)])
                    if step == 0 and 2 * y + 1 < parts.shape[0]:
                        part += np.int64(parts[2 * y + 1, 2 * x])
                    m = put_number(out, m, context, part - guess)
                    off = part * (one + other) - total * one
                    gain += SCALE * off // (one + other) * off // (one * other)
    return m, gain


@njit(cache=True, nogil=True)
def get_parts(words, model, reader, sums, parts, level, height, width, cycles):  # type: ignore[no-untyped-def]
    """Fills in the sums one level below `level`; whether they can be.

    parts: zeros at first. words, model: of the packet. reader: (3,) uint64, code, span and place of
    `open_bits`, changed.
    """
    code, span, at = reader[0], reader[1], np.int64(reader[2])
    data, states = np.int64(words.ctypes.data), np.int64(model.ctypes.data)
    for y in range(sums.shape[0]):
        for x in range(sums.shape[1]):
            for step in range(3):
                total, one, other, part, context, least, most = _part(
                    sums, parts, y, x, step, level, height, width, cycles
                )
                if least < most:
                    d, code, span, at = get_number(
                        data, words.size, states, context, code, span, at
                    )
                    part += d
                    if part < least or part > most:
                        return False
                if step == 0:  # the upper parts stand for their halves until these are split
                    parts[2 * y, 2 * x] = part
                    if other:
                        parts[2 * y, 2 * x + 1] = total - part
                elif one:
                    parts[2 * y, 2 * x + step - 1] = part
                    if other:
                        parts[2 * y + 1, 2 * x + step - 1] = total - part
    reader[0], reader[1], reader[2] = code, span, np.uint64(at)
    return True


def spread(sums: Sums, shape: tuple[int, int]) -> Sums:
    """Counts of (h, w) pixels that make up sums of blocks, as equal as whole numbers can be."""
    if sums.shape == shape:
        return sums
    level = 0
    while -(-shape[0] >> level) > sums.shape[0] or -(-shape[1] >> level) > sums.shape[1]:
        level += 1
    size = 1 << level
    rows, columns = (np.minimum(size, n - np.arange(0, n, size)) for n in shape)
    y, x = (np.arange(n) % size for n in shape)
    place = y[:, None] * np.repeat(columns, columns)[None, :] + x[None, :]
    area = np.repeat(np.repeat(np.outer(rows, columns), rows, axis=0), columns, axis=1)
    whole = np.repeat(np.repeat(sums, rows, axis=0), columns, axis=1).astype(np.int64)
    counts: Sums = ((place + 1) * whole // area - place * whole // area).astype(np.int32)
    return counts
