"""The code `line`: a first spike opens a digital straight line, compiled.

At steady light a pixel that carries its residual fires at floor(phase + n tau): its widths
alternate (3, 3, 4, 3, ...) although nothing happens, and the paper's rule sends most of them. Here
a record is (pixel, t0, spikes, a, b, r): the pixel fires at

    t_n = t0 + floor((a n + r) / b),  n = 0 .. spikes - 1,  0 <= r < b,

tau = a/b. Of the lines through given points it is the one of least b. The encoder makes each line
as long as it can be, one step a spike, by the recognition of Debled-Rennesson and Reveilles (Int.
J. Pattern Recognition and Artificial Intelligence 9:635, 1995): a point (x, y) belongs to the line
while mu <= a x - b y < mu + b; one that misses by one turns the line about the leaning points that
are furthest; one that misses by more ends it. Its remainders do not change under y -> y + c x, so
it serves lines of any slope.

A line of 0 spikes in a column goes on to the stream's end. Unlike the paper's, a record is known
only when its line has ended: this is a code for files, not for a chip's wires.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sensor.codec.bits import lowest_bit, unzigzag, zigzag

LINE_STATE = 13
"""int32 a pixel: t0, spikes, a, b, mu, and x and y of the leaning points: upper first and last,
lower first and last."""
LINE_CARRY = 2
"""int32 a pixel between chunks: last spike and width of its last record."""
LINE_COLUMNS = 7
"""pixels on, gap, spikes, width, b - 1, a mod b - 1, r."""


@njit(cache=True, nogil=True)
def lines(words, first, cycles, state, out):  # type: ignore[no-untyped-def]
    """Records of a band's words, (pixels, n) uint32 whose first bit is cycle `first`, to the rows
    of out (6, room) int32; their number. state: (pixels, LINE_STATE) int32, changed. The last word
    of `cycles` ends every line."""
    count = 0
    last_chunk = first + 32 * words.shape[1] >= cycles
    for p in range(words.shape[0]):
        s = state[p]
        t0, n, a, b, mu = (
            np.int64(s[0]), np.int64(s[1]), np.int64(s[2]), np.int64(s[3]), np.int64(s[4]),
        )  # fmt: skip
        ufx, ufy, ulx, uly = np.int64(s[5]), np.int64(s[6]), np.int64(s[7]), np.int64(s[8])
        lfx, lfy, llx, lly = np.int64(s[9]), np.int64(s[10]), np.int64(s[11]), np.int64(s[12])
        for w in range(words.shape[1]):
            word = np.int64(words[p, w])
            base = np.int64(first) + 32 * w
            while word:
                t = base + lowest_bit(word)
                word &= word - 1
                y = t - t0
                r = a * n - b * y
                if n > 1 and mu <= r < mu + b:
                    if r == mu:
                        ulx, uly = n, y
                    if r == mu + b - 1:
                        llx, lly = n, y
                elif n > 1 and r == mu - 1:
                    lfx, lfy, ulx, uly = llx, lly, n, y
                    a, b = y - ufy, n - ufx
                    mu = a * n - b * y
                elif n > 1 and r == mu + b:
                    ufx, ufy, llx, lly = ulx, uly, n, y
                    a, b = y - lfy, n - lfx
                    mu = a * n - b * y - b + 1
                elif n == 1:
                    a, b, mu = y, np.int64(1), np.int64(0)
                    ufx, ufy, lfx, lfy = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
                    ulx, uly, llx, lly = n, y, n, y
                else:
                    if n:
                        out[0, count], out[1, count], out[2, count] = p, t0, n
                        out[3, count], out[4, count], out[5, count] = a, b, -mu
                        count += 1
                    t0, n = t, np.int64(0)
                n += 1
        if last_chunk and n:
            whole = n > 1 and t0 + (a * n - mu) // b >= cycles
            out[0, count], out[1, count], out[2, count] = p, t0, 0 if whole else n
            out[3, count], out[4, count], out[5, count] = a, b, -mu
            count += 1
        s[0], s[1], s[2], s[3], s[4] = t0, n, a, b, mu
        s[5], s[6], s[7], s[8] = ufx, ufy, ulx, uly
        s[9], s[10], s[11], s[12] = lfx, lfy, llx, lly
    return count


@njit(cache=True, nogil=True)
def to_line(records, carry, columns):  # type: ignore[no-untyped-def]
    """Columns of records (6, n): the rows of columns (LINE_COLUMNS, n) uint32, of which the first
    three are full; the numbers in the fourth, the fifth, the last two. carry: (pixels, LINE_CARRY),
    changed.

    A line of one spike has no slope, one of two has b = 1; b = 1 has no remainder and no phase.
    Gap and width are coded as differences from the width of the pixel's previous line.
    """
    before, wide, bent, broken = np.int64(-1), 0, 0, 0
    for i in range(records.shape[1]):
        p, t0, spikes = np.int64(records[0, i]), np.int64(records[1, i]), np.int64(records[2, i])
        a, b, r = np.int64(records[3, i]), np.int64(records[4, i]), np.int64(records[5, i])
        last, held = np.int64(carry[p, 0]), np.int64(carry[p, 1])
        columns[0, i] = p - before
        columns[1, i] = zigzag(t0 - last - held)
        columns[2, i] = spikes
        before, width = p, t0 - last
        if spikes != 1:
            width = a // b
            columns[3, wide] = zigzag(width - held)
            wide += 1
            if spikes != 2:
                columns[4, bent] = b - 1
                bent += 1
            if b > 1:
                columns[5, broken], columns[6, broken] = a % b - 1, r
                broken += 1
            last = t0 + ((spikes - 1) * a + r) // b
        else:
            last = t0
        carry[p, 0], carry[p, 1] = last, width
    return wide, bent, broken


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def from_line(place, gap, spikes, width, bend, rest, phase, carry, words, cycles):  # type: ignore[no-untyped-def]
    """Sets the spikes of columns in `words`, (pixels, all words of the stream).

    Returns False if `to_line` cannot have written the columns. A pixel whose line extends to the
    end has `cycles` as its last spike.
    """
    p, wide, bent, broken = np.int64(-1), 0, 0, 0
    for i in range(place.size):
        p += np.int64(place[i])
        if p < 0 or p >= words.shape[0]:
            return False
        last, held = np.int64(carry[p, 0]), np.int64(carry[p, 1])
        step = unzigzag(np.int64(gap[i])) + held
        t, n = last + step, np.int64(spikes[i])
        if step < 1 or t >= cycles:
            return False
        b, part, r = np.int64(1), np.int64(0), np.int64(0)
        if n != 1:
            if wide == width.size:
                return False
            step = unzigzag(np.int64(width[wide])) + held
            wide += 1
            if n != 2:
                if bent == bend.size:
                    return False
                b = np.int64(bend[bent]) + 1
                bent += 1
            if b > 1:
                if broken >= rest.size or broken >= phase.size:
                    return False
                part, r = np.int64(rest[broken]) + 1, np.int64(phase[broken])
                broken += 1
            if not 1 <= step <= cycles or part >= b or r >= b:
                return False
        left = n if n else cycles
        while True:  # t and r hold floor and remainder of (a n + r) / b
            words[p, t >> 5] |= np.uint32(1 << (t & 31))
            left -= 1
            r += part
            on = step + (1 if r >= b else 0)
            if left == 0 or (n == 0 and t + on >= cycles):
                break
            t += on
            r -= b if r >= b else 0
            if t >= cycles:
                return False
        carry[p, 0], carry[p, 1] = t if n else cycles, step
    return wide == width.size and bent == bend.size and broken == rest.size == phase.size
