"""The loops of the joint detector: spikes of a cell's pixels as patterns over a symbol's ticks.

A symbol of a row consists of as many ticks as the mode has. The first is the one in which it
begins, which it shares with the previous symbol. The ticks are read in parts of up to PART ticks,
each together with the CONTEXT ticks before it, so that a part is one table look-up.

The kernels take arrays and not records: numba vectorises these loops fully only for plain array
arguments.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from link.detect.geometry import PLACES, SHARES

PART: Final = 4
"""Ticks of a part."""
CONTEXT: Final = 2
"""Ticks before a part, which indicate the charge that a pixel may hold."""
PHASES: Final = 8
"""Classes of the fraction of a tick at which a symbol begins."""
PAIRS: Final = 4
"""Pairs of bits: 2 x the previous symbol's bit + the symbol's bit."""
_WIDTH: Final = PART + CONTEXT
_PATTERNS: Final = 1 << _WIDTH
_MASK: Final = _PATTERNS - 1
RUN: Final = 256
"""Cells that share memory for their evidence."""
STEEP, WIDE = np.float32(0.24904), np.float32(2.5068)
"""Linear approximation of ln(1 + e^-x): Cheng and Ottosson, IEEE VTC 2000."""


@njit(cache=True, nogil=True)
def _begin(time, symbol, row):  # type: ignore[no-untyped-def]
    """Tick in which a symbol begins in a row, and the class of its phase."""
    start = time[0] + symbol * time[1] + time[2] * row / time[3]
    tick = int(np.floor(start))
    return tick, min(int((start - tick) * PHASES), PHASES - 1)


@njit(cache=True, nogil=True)
def place_of(u, v):  # type: ignore[no-untyped-def]
    """Pixel of a cell's centre, and the position within it: x, y, in x, in y."""
    x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
    in_x = min(int((u - x + 0.5) * PLACES), PLACES - 1)
    in_y = min(int((v - y + 0.5) * PLACES), PLACES - 1)
    return x, y, in_x, in_y


@njit(cache=True, nogil=True)
def pattern_of(words, y, x, bit):  # type: ignore[no-untyped-def]
    """_WIDTH spikes of a pixel from tick `bit` on, the first one lowest; 0 outside the words."""
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


@njit(cache=True, nogil=True)
def _pattern_at(flat, size, count, at, bit):  # type: ignore[no-untyped-def]
    """`_pattern` for bit >= 0 in flat words: place `at` of `size`, `count` words."""
    w = bit >> 5
    if w >= count:
        return np.int64(0)
    both = np.int64(flat[w * size + at])
    if (bit & 31) + _WIDTH > 32 and w + 1 < count:
        both |= np.int64(flat[(w + 1) * size + at] & _MASK) << 32
    return (both >> (bit & 31)) & _MASK


@njit(cache=True, nogil=True)
def count_patterns(  # type: ignore[no-untyped-def]
    region0, region1, words, start, known, first_symbol, shift, time, ticks, order, ends, x0, y0,
    count, dx, dy, share, counts,
):  # fmt: skip
    """Counts patterns of known symbols by class. A symbol not wholly within the words is skipped.

    Args:
        region0, region1: regions to count in, first and stop.
        words, start: (n, H, W) uint32 spikes, and the tick of their first bit.
        known: (n + 1, cells) bool, the previous symbol and n symbols.
        first_symbol: number of the first of the n symbols.
        shift: (n, 2) shift of the image, camera pixels.
        time: first, period, slope, rows of the timing.
        ticks: ticks of a symbol.
        order, ends: cells sorted by region, and the end of each region.
        x0, y0: (cells,) centres of the cells, camera pixels.
        count, dx, dy, share: arrays of `geometry.Places`.
        counts: (regions, PHASES, parts, SHARES, PAIRS, patterns) int32, incremented.
    """
    height, width = words.shape[1], words.shape[2]
    stop = words.shape[0] * 32
    for region in range(region0, region1):
        begin = ends[region - 1] if region > 0 else 0
        for o in range(begin, ends[region]):
            cell = order[o]
            for n in range(known.shape[0] - 1):
                x, y, qx, qy = place_of(x0[cell] + shift[n, 0], y0[cell] + shift[n, 1])
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
                        spikes = pattern_of(words, py, px, bit + part * PART)
                        counts[region, phase, part, s, pair, spikes] += 1


@njit(cache=True, nogil=True)
def _either(a, b):  # type: ignore[no-untyped-def]
    """ln(e^a + e^b), linearly approximated."""
    apart = abs(a - b)
    return max(a, b) + (STEEP * (WIDE - apart) if apart < WIDE else np.float32(0.0))


@njit(cache=True, nogil=True)
def _chain(gains, ahead, out, cell, skipped, limit):  # type: ignore[no-untyped-def]
    """Computes the soft values of a chain of bits by a forward and a backward pass.

    Args:
        gains: (symbols, PAIRS) log likelihoods.
        ahead: (symbols, 2) memory for the forward pass.
        out, cell: (n, cells) soft values, and the cell to write.
        skipped: first symbol that is written.
        limit: largest magnitude.
    """
    symbols = gains.shape[0]
    off, on = np.float32(0.0), np.float32(0.0)
    for n in range(symbols):
        off, on = (
            _either(off + gains[n, 0], on + gains[n, 2]),
            _either(off + gains[n, 1], on + gains[n, 3]),
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
            _either(gains[n, 0] + off, gains[n, 1] + on),
            _either(gains[n, 2] + off, gains[n, 3] + on),
        )
        most = max(off, on)
        off, on = off - most, on - most


@njit(cache=True, nogil=True)
def add_evidence(  # type: ignore[no-untyped-def]
    run0, run1, words, start, stop, first_symbol, symbols, skipped, shift, time, ticks, region_of,
    reach, x0, y0, count, dx, dy, share, whole, single, limit, out,
):  # fmt: skip
    """Computes soft values of each cell's bits in the window of `symbols` from first_symbol on.

    Args:
        run0, run1: runs of RUN cells to compute, first and stop.
        words, start, stop: (n, H, W) uint32 spikes, the tick of their first bit, and the number of
            ticks to read.
        first_symbol, symbols, skipped: the window, and the symbols before the first that is
            written.
        shift, time, ticks: shift, time and ticks as in `count_patterns`, shift (symbols, 2).
        region_of, x0, y0: (cells,) region and centre of each cell.
        reach: farthest pixel of a cell from its centre.
        count, dx, dy, share: arrays of `geometry.Places`.
        whole: (regions, PHASES, parts, SHARES, patterns, PAIRS) float32 log likelihoods by pattern.
        single: (regions, PHASES, ticks, SHARES, contexts, 2, PAIRS) float32 log likelihoods by
            tick, for symbols only partly within the words. Both are 0 where both bits are off.
        limit: largest magnitude of a soft value.
        out: (n, cells) float32, of symbols `skipped` to skipped + n of the window.
    """
    height, width = words.shape[1], words.shape[2]
    cells = out.shape[1]
    # Flat arrays: the compiler does not hoist the address computation of six indices.
    flat_words, flat_whole = words.reshape(-1), whole.reshape(-1)
    flat_count, flat_share = count.reshape(-1), share.reshape(-1)
    flat_dx, flat_dy = dx.reshape(-1), dy.reshape(-1)
    most, parts = dx.shape[3], whole.shape[2]
    size, count_words = height * width, words.shape[0]
    for run in range(run0, run1):
        gains = np.empty((symbols, PAIRS), np.float32)
        ahead = np.empty((symbols, 2), np.float32)
        for cell in range(run * RUN, min((run + 1) * RUN, cells)):
            region = region_of[cell]
            for n in range(symbols):
                x, y, qx, qy = place_of(x0[cell] + shift[n, 0], y0[cell] + shift[n, 1])
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
                        spikes = pattern_of(words, py, px, bit + j)
                        before = spikes & ((1 << CONTEXT) - 1)
                        spike = (spikes >> CONTEXT) & 1
                        on += single[region, phase, j, s, before, spike, 1]
                        fell += single[region, phase, j, s, before, spike, 2]
                        both += single[region, phase, j, s, before, spike, 3]
                gains[n, 0], gains[n, 1], gains[n, 2], gains[n, 3] = 0.0, on, fell, both
            _chain(gains, ahead, out, cell, skipped, limit)
