"""The loops of the joint detector: spikes of a cell's pixels as patterns over a symbol's ticks.

A symbol of a row touches `reads` ticks, the mode's ticks and one more. They are read in parts of up
to PART ticks, each together with the CONTEXT ticks before it, so that a part is one look-up.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit, prange

from link.detect.geometry import PLACES

__all__ = ["CONTEXT", "PART", "PHASES", "add_evidence", "count_patterns"]

PART: Final = 4
"""Ticks of a part."""
CONTEXT: Final = 2
"""Ticks before it that say what charge a pixel may hold."""
PHASES: Final = 8
"""Classes of where in a tick a symbol begins."""
_WIDTH: Final = PART + CONTEXT
_MASK = np.uint64((1 << _WIDTH) - 1)


@njit(cache=True, inline="always")
def _begin(first, period, slope, rows, symbol, row):  # type: ignore[no-untyped-def]
    """Tick that a symbol begins in for a row, and class of the phase within."""
    start = first + symbol * period + slope * row / rows
    tick = int(np.floor(start))
    return tick, min(int((start - tick) * PHASES), PHASES - 1)


@njit(cache=True, inline="always")
def _pattern(words, y, x, bit):  # type: ignore[no-untyped-def]
    """_WIDTH spikes of a pixel from tick `bit` of words on, the first one lowest; none beyond."""
    if bit < 0:
        early = np.uint64(words[0, y, x]) << np.uint64(-bit) if bit > -64 else np.uint64(0)
        return early & _MASK
    w, low = bit >> 5, np.uint64(bit & 31)
    if w >= words.shape[0]:
        return np.uint64(0)
    both = np.uint64(words[w, y, x])
    if (bit & 31) + _WIDTH > 32 and w + 1 < words.shape[0]:
        both |= np.uint64(words[w + 1, y, x]) << np.uint64(32)
    return (both >> low) & _MASK


@njit(cache=True, parallel=True)
def count_patterns(  # type: ignore[no-untyped-def]
    words, start, known, first_symbol, shift, time, reads, order, ends, x0, y0, count, dx, dy,
    share, counts,
):  # fmt: skip
    """Counts patterns of known symbols by class.

    known: (n, cells) bool. shift: (n, 2). time: first, period, slope, rows. order, ends: cells by
    region, and where each region ends in it. counts: (regions, PHASES, parts, SHARES, 2,
    patterns) int32, added to. A symbol that is not wholly within the words is left out.
    """
    height, width = words.shape[1], words.shape[2]
    stop = words.shape[0] * 32
    for region in prange(ends.size):
        begin = ends[region - 1] if region > 0 else 0
        for o in range(begin, ends[region]):
            cell = order[o]
            for n in range(known.shape[0]):
                u, v = x0[cell] + shift[n, 0], y0[cell] + shift[n, 1]
                x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
                qx = min(int((u - x + 0.5) * PLACES), PLACES - 1)
                qy = min(int((v - y + 0.5) * PLACES), PLACES - 1)
                tick, phase = _begin(time[0], time[1], time[2], time[3], first_symbol + n, v)
                bit = tick - start - CONTEXT
                if bit < 0 or bit + CONTEXT + reads > stop:
                    continue
                own = 1 if known[n, cell] else 0
                for k in range(count[region, qy, qx]):
                    py, px = y + dy[region, qy, qx, k], x + dx[region, qy, qx, k]
                    if py < 0 or px < 0 or py >= height or px >= width:
                        continue
                    s = share[region, qy, qx, k]
                    for part in range(counts.shape[2]):
                        seen = _pattern(words, py, px, bit + part * PART)
                        counts[region, phase, part, s, own, seen] += 1


@njit(cache=True, parallel=True)
def add_evidence(  # type: ignore[no-untyped-def]
    words, start, first_symbol, shift, time, reads, region_of, x0, y0, count, dx, dy, share, whole,
    single, limit, out,
):  # fmt: skip
    """Adds up what the spikes say of each cell's bit.

    whole: (regions, PHASES, parts, SHARES, patterns) float32, by pattern. single: (regions,
    PHASES, reads, SHARES, contexts, 2) float32, by tick, for symbols that the words hold in part.
    limit: of the sum's size. out: (n, cells) float32.
    """
    height, width = words.shape[1], words.shape[2]
    stop = words.shape[0] * 32
    for cell in prange(out.shape[1]):
        region = region_of[cell]
        for n in range(out.shape[0]):
            u, v = x0[cell] + shift[n, 0], y0[cell] + shift[n, 1]
            x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
            qx = min(int((u - x + 0.5) * PLACES), PLACES - 1)
            qy = min(int((v - y + 0.5) * PLACES), PLACES - 1)
            tick, phase = _begin(time[0], time[1], time[2], time[3], first_symbol + n, v)
            bit = tick - start - CONTEXT
            inside = bit >= 0 and bit + CONTEXT + reads <= stop
            total = np.float32(0.0)
            for k in range(count[region, qy, qx]):
                py, px = y + dy[region, qy, qx, k], x + dx[region, qy, qx, k]
                if py < 0 or px < 0 or py >= height or px >= width:
                    continue
                s = share[region, qy, qx, k]
                if inside:
                    for part in range(whole.shape[2]):
                        seen = _pattern(words, py, px, bit + part * PART)
                        total += whole[region, phase, part, s, seen]
                else:
                    for j in range(reads):
                        if bit + j + CONTEXT < 0 or bit + j + CONTEXT >= stop:
                            continue
                        seen = _pattern(words, py, px, bit + j)
                        before = seen & np.uint64((1 << CONTEXT) - 1)
                        spike = (seen >> np.uint64(CONTEXT)) & np.uint64(1)
                        total += single[region, phase, j, s, before, spike]
            out[n, cell] = min(max(total, -limit), limit)
