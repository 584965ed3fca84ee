"""The loops of the joint detector: spikes of a cell's pixels as patterns over a symbol's ticks.

A symbol of a row owns as many ticks as the mode says, the first of them being the one it begins in,
which it shares with the symbol before. They are read in parts of up to PART ticks, each together
with the CONTEXT ticks before it, so that a part is one look-up.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit, prange

from link.detect.geometry import PLACES, SHARES

__all__ = ["CONTEXT", "PAIRS", "PART", "PHASES", "add_evidence", "count_patterns"]

PART: Final = 4
"""Ticks of a part."""
CONTEXT: Final = 2
"""Ticks before it that say what charge a pixel may hold."""
PHASES: Final = 8
"""Classes of where in a tick a symbol begins."""
PAIRS: Final = 4
"""Of bits, that of the symbol before and the symbol's own: 2 before + own."""
_WIDTH: Final = PART + CONTEXT
_PATTERNS: Final = 1 << _WIDTH
_MASK: Final = _PATTERNS - 1
_RUN: Final = 256
"""Cells that a thread takes at once."""
_STEEP, _WIDE = np.float32(0.24904), np.float32(2.5068)
"""Linear approximation of ln(1 + e^-x): Cheng and Ottosson, IEEE VTC 2000."""


@njit(cache=True)
def _begin(time, symbol, row):  # type: ignore[no-untyped-def]
    """Tick that a symbol begins in for a row, and class of the phase within."""
    start = time[0] + symbol * time[1] + time[2] * row / time[3]
    tick = int(np.floor(start))
    return tick, min(int((start - tick) * PHASES), PHASES - 1)


@njit(cache=True)
def _place(u, v):  # type: ignore[no-untyped-def]
    """Pixel that a cell's centre lies in, and its place there: x, y, in x, in y."""
    x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
    in_x = min(int((u - x + 0.5) * PLACES), PLACES - 1)
    in_y = min(int((v - y + 0.5) * PLACES), PLACES - 1)
    return x, y, in_x, in_y


@njit(cache=True)
def _pattern(words, y, x, bit):  # type: ignore[no-untyped-def]
    """_WIDTH spikes of a pixel from tick `bit` of words on, the first one lowest; none beyond."""
    if bit < 0:
        early = np.int64(words[0, y, x]) << -bit if bit > -_WIDTH else 0
        return early & _MASK
    w = bit >> 5
    if w >= words.shape[0]:
        return np.int64(0)
    both = np.int64(words[w, y, x])
    if (bit & 31) + _WIDTH > 32 and w + 1 < words.shape[0]:
        both |= np.int64(words[w + 1, y, x] & _MASK) << 32
    return (both >> (bit & 31)) & _MASK


@njit(cache=True)
def _pattern_at(flat, size, count, at, bit):  # type: ignore[no-untyped-def]
    """The same of a pixel at a place of `size`, in flat words of `count`, from bit >= 0 on."""
    w = bit >> 5
    if w >= count:
        return np.int64(0)
    both = np.int64(flat[w * size + at])
    if (bit & 31) + _WIDTH > 32 and w + 1 < count:
        both |= np.int64(flat[(w + 1) * size + at] & _MASK) << 32
    return (both >> (bit & 31)) & _MASK


@njit(cache=True, parallel=True)
def count_patterns(  # type: ignore[no-untyped-def]
    words, start, known, first_symbol, shift, time, ticks, order, ends, x0, y0, count, dx, dy,
    share, counts,
):  # fmt: skip
    """Counts patterns of known symbols by class.

    known: (n + 1, cells) bool, the symbol before the first one and n symbols. shift: (n, 2). time:
    first, period, slope, rows. order, ends: cells by region, and where each region ends in it.
    counts: (regions, PHASES, parts, SHARES, PAIRS, patterns) int32, added to. A symbol that is not
    wholly within the words is left out.
    """
    height, width = words.shape[1], words.shape[2]
    stop = words.shape[0] * 32
    for region in prange(ends.size):
        begin = ends[region - 1] if region > 0 else 0
        for o in range(begin, ends[region]):
            cell = order[o]
            for n in range(known.shape[0] - 1):
                x, y, qx, qy = _place(x0[cell] + shift[n, 0], y0[cell] + shift[n, 1])
                tick, phase = _begin(time, first_symbol + n, y)
                bit = tick - start - CONTEXT
                if bit < 0 or bit + CONTEXT + ticks > stop:
                    continue
                pair = 2 * int(known[n, cell]) + int(known[n + 1, cell])
                for k in range(count[region, qy, qx]):
                    py, px = y + dy[region, qy, qx, k], x + dx[region, qy, qx, k]
                    if py < 0 or px < 0 or py >= height or px >= width:
                        continue
                    s = np.int64(share[region, qy, qx, k])
                    for part in range(counts.shape[2]):
                        spikes = _pattern(words, py, px, bit + part * PART)
                        counts[region, phase, part, s, pair, spikes] += 1


@njit(cache=True)
def _either(a, b):  # type: ignore[no-untyped-def]
    """ln(e^a + e^b), linearly approximated."""
    apart = abs(a - b)
    return max(a, b) + (_STEEP * (_WIDE - apart) if apart < _WIDE else np.float32(0.0))


@njit(cache=True)
def _chain(said, ahead, out, cell, skipped, limit):  # type: ignore[no-untyped-def]
    """Soft values of a chain of bits from said (symbols, PAIRS): forward and backward over the two
    values of a bit. ahead: room for the forward pass, (symbols, 2)."""
    symbols = said.shape[0]
    off, on = np.float32(0.0), np.float32(0.0)
    for n in range(symbols):
        off, on = (
            _either(off + said[n, 0], on + said[n, 2]),
            _either(off + said[n, 1], on + said[n, 3]),
        )
        most = max(off, on)
        off, on = off - most, on - most
        ahead[n, 0], ahead[n, 1] = off, on
    off, on = np.float32(0.0), np.float32(0.0)
    for n in range(symbols - 1, skipped - 1, -1):
        if n - skipped < out.shape[0]:
            value = ahead[n, 1] + on - ahead[n, 0] - off
            out[n - skipped, cell] = min(max(value, -limit), limit)
        off, on = (
            _either(said[n, 0] + off, said[n, 1] + on),
            _either(said[n, 2] + off, said[n, 3] + on),
        )
        most = max(off, on)
        off, on = off - most, on - most


@njit(cache=True, parallel=True)
def add_evidence(  # type: ignore[no-untyped-def]
    words, start, stop, first_symbol, symbols, skipped, shift, time, ticks, region_of, x0, y0,
    count, dx, dy, share, whole, single, limit, out,
):  # fmt: skip
    """Soft values of each cell's bits in the window of `symbols` from first_symbol on.

    stop: ticks of the words that are read. whole: (regions, PHASES, parts, SHARES, patterns, PAIRS)
    float32, by pattern. single: (regions, PHASES, ticks, SHARES, contexts, 2, PAIRS) float32, by
    tick, for symbols that the words hold in part; both are 0 where both bits are off. out: (n,
    cells) float32, of the window's symbols `skipped` to skipped + n.
    """
    height, width = words.shape[1], words.shape[2]
    cells = out.shape[1]
    # flat, since the compiler does not take apart what it indexes by six numbers
    flat_words, flat_whole = words.reshape(-1), whole.reshape(-1)
    flat_count, flat_share = count.reshape(-1), share.reshape(-1)
    flat_dx, flat_dy = dx.reshape(-1), dy.reshape(-1)
    most, parts, reach = dx.shape[3], whole.shape[2], max(np.abs(dx).max(), np.abs(dy).max())
    size, count_words = height * width, words.shape[0]
    for run in prange(-(-cells // _RUN)):
        said = np.empty((symbols, PAIRS), np.float32)
        ahead = np.empty((symbols, 2), np.float32)
        for cell in range(run * _RUN, min((run + 1) * _RUN, cells)):
            region = region_of[cell]
            for n in range(symbols):
                x, y, qx, qy = _place(x0[cell] + shift[n, 0], y0[cell] + shift[n, 1])
                tick, phase = _begin(time, first_symbol + n, y)
                bit = tick - start - CONTEXT
                inside = bit >= 0 and bit + CONTEXT + ticks <= stop
                on, fell, both = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                place = (region * PLACES + qy) * PLACES + qx
                law = (region * PHASES + phase) * parts
                clear = reach <= x < width - reach and reach <= y < height - reach
                for k in range(place * most, place * most + flat_count[place]):
                    py, px, s = y + flat_dy[k], x + flat_dx[k], np.int64(flat_share[k])
                    if not clear and (py < 0 or px < 0 or py >= height or px >= width):
                        continue
                    if inside:
                        at = py * width + px
                        for part in range(parts):
                            spikes = _pattern_at(
                                flat_words, size, count_words, at, bit + part * PART
                            )
                            row = (((law + part) * SHARES + s) * _PATTERNS + spikes) * PAIRS
                            on += flat_whole[row + 1]
                            fell += flat_whole[row + 2]
                            both += flat_whole[row + 3]
                        continue
                    for j in range(ticks):
                        if bit + j + CONTEXT < 0 or bit + j + CONTEXT >= stop:
                            continue
                        spikes = _pattern(words, py, px, bit + j)
                        before = spikes & ((1 << CONTEXT) - 1)
                        spike = (spikes >> CONTEXT) & 1
                        on += single[region, phase, j, s, before, spike, 1]
                        fell += single[region, phase, j, s, before, spike, 2]
                        both += single[region, phase, j, s, before, spike, 3]
                said[n, 0], said[n, 1], said[n, 2], said[n, 3] = 0.0, on, fell, both
            _chain(said, ahead, out, cell, skipped, limit)
