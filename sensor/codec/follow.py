"""The codes `repeat` and `statistical` of latched words, compiled: a pixel's current width is
followed from spike to spike.

A record is (pixel, t, width, spikes): the pixel fired at t, and the `spikes` intervals that end
there took `width` ticks in all; spikes is 1 for a first spike. Between two records of a pixel the
decoder fills what lies before the second one's beginning with the whole number of intervals that
comes nearest to the first one's mean width, evenly spread, and ends on that beginning, which is a
true spike. Where widths repeat exactly that is the paper's rule, spike by spike.

A statistical record is sent when a width differs from the current mean by more than k times what
physics lets it (law.py). With `refine` = n > 0 the next n widths in force are averaged, and the
mean is sent in a second record and becomes current; later means of n are sent when they differ by
more than k times what two such means may. Telescoping sums make the latch's share of a mean's
variance LATCH_VARIANCE / n^2.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sensor.codec.bits import lowest_bit, unzigzag, zigzag
from sensor.codec.law import LATCH_VARIANCE

FOLLOW_STATE = 6
"""int32 a pixel: last spike, current width in all, its spikes, begin of the mean that is being
taken, widths in it, whether there was a spike."""
SPACED_CARRY = 3
"""int32 a pixel between chunks: t, width and spikes of its last record."""


@njit(cache=True, nogil=True)
def _bounds(mean, spikes, rsd2, k, refine):  # type: ignore[no-untyped-def]
    """How far a width, and how far a mean of `refine` widths, may lie from the current mean."""
    if k == 0.0:
        return 0.0, 0.0
    n = max(refine, 1)
    one = mean * mean * rsd2 + LATCH_VARIANCE
    many = mean * mean * rsd2 / n + LATCH_VARIANCE / (n * n)
    last = many if spikes > 1 else 0.0  # the plain rule compares with k sigma of one width
    return k * math.sqrt(one + last), k * math.sqrt(2 * many)


@njit(cache=True, nogil=True)
def follow(words, first, cycles, state, rsd2, k, refine, out):  # type: ignore[no-untyped-def]
    """Writes the records of a band's words to the rows of `out`, and returns their number.

    words: (pixels, n) uint32, whose first bit is cycle `first`. out: (4, room) int32. state:
    (pixels, FOLLOW_STATE) int32, changed. At the last word of `cycles`, open records are closed.
    """
    n = 0
    last_chunk = first + 32 * words.shape[1] >= cycles
    for p in range(words.shape[0]):
        last, width, spikes, begin, held = (
            np.int64(state[p, 0]), np.int64(state[p, 1]), np.int64(state[p, 2]),
            np.int64(state[p, 3]), np.int64(state[p, 4]),
        )  # fmt: skip
        mean = width / spikes
        bound, bound_mean = _bounds(mean, spikes, rsd2, k, refine)
        for w in range(words.shape[1]):
            word = np.int64(words[p, w])
            base = np.int64(first) + 32 * w
            while word:
                t = base + lowest_bit(word)
                word &= word - 1
                gap = t - last
                last = t
                sent = width == 0 or abs(gap - mean) > bound
                if sent:
                    width, spikes = gap, np.int64(1)
                elif refine:
                    held += 1
                    if held < refine:
                        continue
                    total = t - begin
                    begin, held = t, np.int64(0)
                    sent = spikes == 1 or abs(total / refine - mean) > bound_mean
                    if sent:
                        width, spikes = total, np.int64(refine)
                if sent:
                    out[0, n], out[1, n], out[2, n], out[3, n] = p, t, width, spikes
                    n += 1
                    begin, held = t, np.int64(0)
                    mean = width / spikes
                    bound, bound_mean = _bounds(mean, spikes, rsd2, k, refine)
        if last_chunk and width and cycles - last > mean + bound:
            out[0, n], out[1, n], out[2, n], out[3, n] = p, cycles, cycles - last, 1
            n += 1
        state[p, 0], state[p, 1], state[p, 2], state[p, 3], state[p, 4] = (
            last, width, spikes, begin, held,
        )  # fmt: skip
    return n


@njit(cache=True, nogil=True)
def to_spaced(records, exact, refine, carry, columns):  # type: ignore[no-untyped-def]
    """Columns (4, n) uint32 of records (4, n): pixels on from the record before; gap between the
    pixel's last record and the beginning of this one (exact: in current widths); width minus the
    current one; 1 for a mean of `refine` widths. carry: (pixels, SPACED_CARRY), changed."""
    before = np.int64(-1)
    for i in range(records.shape[1]):
        p = np.int64(records[0, i])
        t, width, spikes = np.int64(records[1, i]), np.int64(records[2, i]), np.int64(records[3, i])
        last, held, share = np.int64(carry[p, 0]), np.int64(carry[p, 1]), np.int64(carry[p, 2])
        gap = t - width - last
        columns[0, i] = p - before
        columns[1, i] = gap // (held if held else 1) if exact else gap
        code = zigzag(width - (2 * held * spikes + share) // (2 * share))
        columns[2, i] = code if refine else code - 1  # without means it is never 0
        columns[3, i] = spikes > 1
        carry[p, 0], carry[p, 1], carry[p, 2] = t, width, spikes
        before = p


@njit(cache=True, nogil=True)
def _fill(words, p, begin, span, spikes, cycles):  # type: ignore[no-untyped-def]
    """Spikes begin + floor(j span / spikes), j = 1 .. spikes, those before `cycles`."""
    for j in range(1, spikes + 1):
        t = begin + j * span // spikes
        if t >= cycles:
            break
        words[p, t >> 5] |= np.uint32(1 << (t & 31))


@njit(cache=True, nogil=True)
def from_spaced(columns, exact, refine, carry, words, cycles):  # type: ignore[no-untyped-def]
    """Draws the spikes of columns (4, n) into words (pixels, all of the stream's); whether they
    are such as `to_spaced` makes."""
    p = np.int64(-1)
    for i in range(columns.shape[1]):
        p += np.int64(columns[0, i])
        if p < 0 or p >= words.shape[0]:
            return False
        last, held, share = np.int64(carry[p, 0]), np.int64(carry[p, 1]), np.int64(carry[p, 2])
        code = np.int64(columns[2, i]) + (0 if refine else 1)
        mean = columns[3, i] == 1
        spikes = np.int64(refine) if mean else np.int64(1)
        width = (2 * held * spikes + share) // (2 * share) + unzigzag(code)
        gap = np.int64(columns[1, i])
        if exact:
            gap *= held
        begin = last + gap
        t = begin + width
        if columns[3, i] > 1 or last >= cycles or width < spikes or gap < 0 or t > cycles:
            return False
        if gap and held == 0:
            return False
        if gap:
            count = min(max((2 * gap * share + held) // (2 * held), 1), gap)
            _fill(words, p, last, gap, count, cycles)
        _fill(words, p, begin, width, spikes, cycles)
        carry[p, 0], carry[p, 1], carry[p, 2] = t, width, spikes
    return True


@njit(cache=True, nogil=True)
def close_spaced(carry, words, cycles):  # type: ignore[no-untyped-def]
    """Lets the last record of every pixel repeat up to the stream's end."""
    for p in range(words.shape[0]):
        last, held, share = np.int64(carry[p, 0]), np.int64(carry[p, 1]), np.int64(carry[p, 2])
        if held == 0 or last >= cycles:
            continue
        t, j = last, np.int64(0)
        while t < cycles:
            words[p, t >> 5] |= np.uint32(1 << (t & 31))
            j += 1
            t = last + j * held // share
