"""The times of a pixel's spikes, coarse to fine, compiled.

Spikes of a pixel in a packet are numbered 1 to n. Level h = 2^k sends those whose number is an odd
multiple of h; it lies between its neighbours i - h and i + h, which coarser levels have sent, and
is expected halfway. At the ends, where a neighbour is missing, half the next span takes its place.
Where the light of its block changes, halfway is a matter of the block's spikes, not of cycles, on
the levels from _BENT on. A decoder that has stopped at a level spreads the spikes between alike.

The course of a block says how many of its spikes there are up to a cycle. It is linear within each
word of 32 cycles. Spikes of a pixel whose times are unknown are expected to lie evenly in this
count, not in time.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import WORD
from sensor.codec.packets.ranges import (
    NUMBER,
    get_number,
    open_bits,
    peek16,
    poke16,
    put_number,
    trailing_zeros,
)

SPAN_LEVEL = 2
"""Level of the sums whose course is known, blocks of 2^2 x 2^2 pixels."""
ONE = 16
"""Binary places of a count of spikes."""
_SIZES = 20
_SIDES = 5
_EDGES = 3 * 2 * _SIDES * _SIZES
_CHANGING = (2 * _SIZES * _SIDES * _SIDES + _EDGES) * NUMBER
"""First context of the numbers in blocks that change."""
TIME_CONTEXTS = _CHANGING + _SIZES * NUMBER
_BENT = 4
"""Level from which on the course of a block is followed: finer spans are within a few words."""
_MOST = 512
_LEVELS = 9
WINDOW = 41
"""Cycles of the window whose counts a gain is about: that of TFP in every report."""
SCALE = 1 << 16
"""Unit of gains."""
MOST_DECISIONS = 24
"""Decisions of a spike, at most: those of a number of 9 bits with a sign."""


def course_of(
    spans: npt.NDArray[np.int32], cycles: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """(spikes of each block before each word and in all, (rows, columns, n + 1); whether a block
    changes, (rows, columns)) of (n, rows, columns) spans."""
    n, rows, columns = spans.shape
    course = np.zeros((rows, columns, n + 1), np.int64)
    np.cumsum(np.moveaxis(spans, 0, -1), axis=-1, out=course[..., 1:])
    begun = np.minimum(WORD * np.arange(n + 1), cycles)
    whole = course[..., -1:]
    changes = (np.abs(course * cycles - whole * begun) >= cycles).any(axis=-1)
    return course, changes


@njit(cache=True, nogil=True)
def spikes_up_to(course, t, cycles):  # type: ignore[no-untyped-def]
    """Spikes, in 2^-ONE, up to the middle of cycle t. course: of one block."""
    w = t // WORD
    length = min(WORD, cycles - WORD * w)
    own = (course[w + 1] - course[w]) << ONE
    return (course[w] << ONE) + own * (2 * (t - WORD * w) + 1) // (2 * length)


@njit(cache=True, nogil=True)
def time_of(course, spikes, cycles):  # type: ignore[no-untyped-def]
    """The cycle in which a count of `spikes`, in 2^-ONE, is reached; 0 to cycles - 1."""
    w = 0
    while w + 2 < course.size and course[w + 1] << ONE <= spikes:
        w += 1
    own = (course[w + 1] - course[w]) << ONE
    length = min(WORD, cycles - WORD * w)
    inside = (spikes - (course[w] << ONE)) * length // own if own else 0
    return WORD * w + min(max(inside, 0), length - 1)


def _classes() -> npt.NDArray[np.int64]:
    """Class of the mean interval: two for each octave."""
    mean = np.arange(1, _MOST + 2)
    octave = np.array([int(n).bit_length() - 1 for n in mean])
    return (2 * octave + (2 * mean >= 3 << octave)).clip(0, _SIZES - 1)


def _weights() -> npt.NDArray[np.int64]:
    """Weight of a squared deviation, (2h d)^2, of a midpoint of `span` cycles, times SCALE.

    A midpoint that is d too early moves the 2h spikes of its span: the number of spikes up to then
    is wrong by a triangle of height 2 h d / span. What a window of W cycles counts is wrong by the
    difference of the triangle at its ends. Summed over windows that is (2 h d)^2 / span times 2/3,
    if the span is shorter than the window, or 4 (W / span)^2, its slope, if it is longer.
    """
    span = np.arange(1, _MOST + 1)
    share = np.minimum(2 / 3, 4 * (WINDOW / span) ** 2) / span
    return np.concatenate([[0], np.round(4 * SCALE * share)]).astype(np.int64)


_WEIGHT = _weights()

_CLASS = np.concatenate([[0], _classes()]).astype(np.int64)


def _kinds() -> npt.NDArray[np.int64]:
    """First context of a midpoint between steady neighbours, by level and span: one set for each
    class of the mean interval and each parity of the span."""
    level, span = np.ogrid[:_LEVELS, : _MOST + 1]
    place = 2 * _CLASS[span >> (level + 1)] + span % 2
    return ((place * _SIDES + 2) * _SIDES + 2) * NUMBER


_KIND = _kinds()


@njit(cache=True, nogil=True)
def find_spikes(words, times, starts):  # type: ignore[no-untyped-def]
    """Lists the spikes of a tile.

    words: (n, h, w) uint32. times: int16 with room for all spikes; those of pixel p, in raster
    order, stand in starts[p] to starts[p + 1]. starts: (pixels + 1,) int32.
    """
    at, pixel = 0, 0
    starts[0] = 0
    for y in range(words.shape[1]):
        for x in range(words.shape[2]):
            for w in range(words.shape[0]):
                word = words[w, y, x]
                while word:
                    times[at] = 32 * w + trailing_zeros(word)
                    word &= word - np.uint32(1)
                    at += 1
            pixel += 1
            starts[pixel] = at


@njit(cache=True, nogil=True, inline="always")
def _between(times, i, k, n):  # type: ignore[no-untyped-def]
    """(time, contexts, least, most, span) of spike i on level k, whose neighbours are both there.

    times: address of int16 such that entry j is the time of spike j.
    """
    h = 1 << k
    a, b = peek16(times, i - h), peek16(times, i + h)
    whole = b - a
    half = whole & 1
    x = 2 * (a - peek16(times, i - 2 * h)) - whole
    y = peek16(times, min(i + 3 * h, n)) - b - whole if i + 3 * h <= n else 0
    kind = _KIND[k, whole] + (min(max(x, -2), 2) * _SIDES + min(max(y, -2), 2)) * NUMBER
    up = half & (1 if x < 0 else 0)
    return a + (whole >> 1) + up, kind, a + h, b - h, whole


@njit(cache=True, nogil=True)
def _at_edge(times, i, k, n, cycles):  # type: ignore[no-untyped-def]
    """The same of a spike that lacks one of its neighbours or both."""
    h = 1 << k
    left, right = i > h, i + h <= n
    half, skew = 0, 0
    if left:
        a = peek16(times, i - h)
        least, most = a + h, cycles - 1 - (n - i)
        if i > 3 * h:
            whole = a - peek16(times, i - 3 * h)
            half, skew = whole & 1, 2 * (a - peek16(times, i - 2 * h)) - whole
            t, edge = a + (whole >> 1), 0
        else:
            whole = (2 * cycles - 2 * a - 1) * 2 * h // (2 * (n - i + h) + 1)
            t, edge = a + (whole >> 1), 2
    elif right:
        b = peek16(times, i + h)
        least, most = h - 1, b - h
        if i + 3 * h <= n:
            whole = peek16(times, i + 3 * h) - b
            if i + 5 * h <= n:
                skew = peek16(times, i + 5 * h) - peek16(times, i + 3 * h) - whole
            half = whole & 1
            t, edge = b - ((whole + 1) >> 1), 1
        else:
            whole = (2 * b + 1) * 2 * h // (4 * h - 1)
            t, edge = b - (whole >> 1), 2
    else:
        least, most = h - 1, cycles - 1 - (n - i)
        whole = cycles * 2 * h // n
        t, edge = cycles * (2 * i - 1) // (2 * n), 2
    kind = (edge * _SIZES + _CLASS[min(whole >> (k + 1), _MOST)]) * 2 + half
    kind = kind * _SIDES + min(max(skew, -2), 2) + 2 + 2 * _SIZES * _SIDES * _SIDES
    return min(max(t, least), most), kind * NUMBER, least, most, whole


@njit(cache=True, nogil=True)
def _on_course(times, i, k, n, cycles, course):  # type: ignore[no-untyped-def]
    """The same of a spike in a block that changes. course: of the block."""
    h = 1 << k
    least, most, begun, ended = h - 1, cycles - 1 - (n - i), 0, course[-1] << ONE
    share, span, whole = 2 * i - 1, 2 * n, cycles * 2 * h // n
    left, right = i > h, i + h <= n
    if left:
        a = peek16(times, i - h)
        least, begun = a + h, spikes_up_to(course, a, cycles)
        share, span, whole = 2 * h, 2 * (n - i + h) + 1, 2 * (cycles - a) * h // (n - i + h)
    if right:
        b = peek16(times, i + h)
        most, ended = b - h, spikes_up_to(course, b, cycles)
        share, span, whole = 2 * i - 1, 2 * (i + h) - 1, b * 2 * h // (i + h)
    if left and right:
        share, span, whole = 1, 2, b - a
    t = time_of(course, begun + (ended - begun) * share // span, cycles)
    kind = _CHANGING + _CLASS[min(whole >> (k + 1), _MOST)] * NUMBER
    return min(max(t, least), most), kind, least, most, whole


@njit(cache=True, nogil=True)
def _most_spikes(starts):  # type: ignore[no-untyped-def]
    most = np.int32(0)
    for p in range(starts.size - 1):
        most = max(most, starts[p + 1] - starts[p])
    return most


@njit(cache=True, nogil=True)
def put_times(times, starts, course, changes, width, high, low, cycles, decisions):  # type: ignore[no-untyped-def]
    """Decisions of levels `high` down to `low`; (their number, spikes, gain).

    course, changes: of `course_of`. width: of the tile, pixels.
    decisions: uint16, with room for MOST_DECISIONS a spike. The gain is what the spikes take away
    of the squared error of counts in a window (`_weights`), summed over windows, times SCALE.
    """
    m, spikes, gain = 0, 0, 0
    out, base = np.int64(decisions.ctypes.data), np.int64(times.ctypes.data)
    most_spikes = _most_spikes(starts)
    for k in range(high, low - 1, -1):
        h = 1 << k
        if h > most_spikes:
            continue
        for p in range(starts.size - 1):
            n = np.int64(starts[p + 1] - starts[p])
            o = base + 2 * (np.int64(starts[p]) - 1)
            i = h
            y, x = p // width >> SPAN_LEVEL, p % width >> SPAN_LEVEL
            bent = k >= _BENT and changes[y, x]
            while i <= n:
                if bent or i == h or i + h > n:
                    if bent:
                        t, kind, least, most, whole = _on_course(o, i, k, n, cycles, course[y, x])
                    else:
                        t, kind, least, most, whole = _at_edge(o, i, k, n, cycles)
                    if least < most:
                        d = peek16(o, i) - t
                        m = put_number(out, m, kind, d)
                        gain += (d * d << 2 * k) * _WEIGHT[min(whole, _MOST)]
                    i += 2 * h
                while not bent and i + h <= n:
                    t, kind, least, most, whole = _between(o, i, k, n)
                    if least < most:
                        d = peek16(o, i) - t
                        m = put_number(out, m, kind, d)
                        gain += (d * d << 2 * k) * _WEIGHT[whole]
                    i += 2 * h
            spikes += int((n + h) >> (k + 1))
    return m, spikes, gain


@njit(cache=True, nogil=True)
def get_times(words, model, starts, course, changes, width, high, low, cycles, times):  # type: ignore[no-untyped-def]
    """Fills in the times of levels `high` down to `low`; whether they can be.

    words, model: of the packet. course, changes, width: as of `put_times`. times, starts: as
    `find_spikes` makes them, coarser levels known.
    """
    code, span, at = open_bits(words)
    size, data, states = words.size, np.int64(words.ctypes.data), np.int64(model.ctypes.data)
    base, most_spikes = np.int64(times.ctypes.data), _most_spikes(starts)
    for k in range(high, low - 1, -1):
        h = 1 << k
        if h > most_spikes:
            continue
        for p in range(starts.size - 1):
            n = np.int64(starts[p + 1] - starts[p])
            o = base + 2 * (np.int64(starts[p]) - 1)
            i = h
            y, x = p // width >> SPAN_LEVEL, p % width >> SPAN_LEVEL
            bent = k >= _BENT and changes[y, x]
            while i <= n:
                if bent:
                    t, kind, least, most, _ = _on_course(o, i, k, n, cycles, course[y, x])
                elif i > h and i + h <= n:
                    t, kind, least, most, _ = _between(o, i, k, n)
                else:
                    t, kind, least, most, _ = _at_edge(o, i, k, n, cycles)
                if least < most:
                    d, code, span, at = get_number(data, size, states, kind, code, span, at)
                    t += d
                    if t < least or t > most:
                        return False
                poke16(o, i, t)
                i += 2 * h
    return True
