"""Spikes that were not sent, spread evenly between those that were; and times as bits of words."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import Words, words_for
from sensor.codec.packets.midpoints import ONE, SPAN_LEVEL, WINDOW, course_of, spikes_up_to, time_of
from sensor.codec.packets.ranges import peek16, poke16
from sensor.codec.packets.spans import even_spans

_NONE = 10
"""A level that no packet reaches."""
_SIDE = 8
"""Side of the matrix of phases, pixels; tiles are multiples of it."""
_FINE = 2 * _SIDE * _SIDE
"""Phases of an interval."""


def _phases() -> npt.NDArray[np.int64]:
    """Phase of dim trains without a known spike, by row and column modulo _SIDE, in 1 / _FINE of
    an interval: ordered dither (Bayer 1973). Equal trains of one phase would all fire at once,
    and a dim area would be dark in one window and bright in another. Brighter trains have spikes in
    every window, and one phase is nearer to the truth at both ends of a packet."""
    order = np.zeros((1, 1), np.int64)
    while len(order) < _SIDE:
        order = np.block([[4 * order, 4 * order + 2], [4 * order + 3, 4 * order + 1]])
    return 2 * order + 1


_PHASE = _phases()


@njit(cache=True, nogil=True)
def fill_times(times, starts, course, changes, width, low, cycles):  # type: ignore[no-untyped-def]
    """Fills in the times of all levels below `low`; the others are known.

    Between two known spikes those of equal spacing, to the nearest cycle. The packet's ends stand
    half a spacing beyond the first and the last spike. A train of which no spike is known has equal
    spacing, and the phase of its pixel if its intervals are longer than WINDOW cycles. In a block
    that changes, the spacing is of its spikes.
    times, starts: as `find_spikes` makes them. course, changes: of `course_of`. width: of the tile,
    pixels.
    """
    step = 1 << low
    base = np.int64(times.ctypes.data)
    for p in range(starts.size - 1):
        n = np.int64(starts[p + 1] - starts[p])
        o = base + 2 * (np.int64(starts[p]) - 1)
        phase = _FINE >> 1
        if n * WINDOW < cycles:
            phase = _PHASE[p // width % _SIDE, p % width % _SIDE]
        y, x = p // width >> SPAN_LEVEL, p % width >> SPAN_LEVEL
        if changes[y, x]:
            _fill_changing(o, n, step, course[y, x], phase, cycles)
            continue
        if n < step:
            for i in range(1, n + 1):
                poke16(o, i, cycles * (_FINE * (i - 1) + phase) // (_FINE * n))
            continue
        a = peek16(o, step)
        for i in range(1, step):
            poke16(o, i, ((2 * a + 1) * (2 * i - 1) // (2 * step - 1)) >> 1)
        at = step
        while at + step <= n:
            whole = peek16(o, at + step) - a
            for q in range(1, step):
                poke16(o, at + q, a + ((whole * q + (step >> 1)) >> low))
            at += step
            a += whole
        rest = 2 * (n - at) + 1
        for i in range(at + 1, n + 1):
            poke16(o, i, (2 * a + 1 + (2 * (cycles - a) - 1) * 2 * (i - at) // rest) >> 1)


@njit(cache=True, nogil=True)
def _fill_changing(o, n, step, course, phase, cycles):  # type: ignore[no-untyped-def]
    """The same of one train in a block that changes. phase: of a train without a known spike."""
    before, begun, at = np.int64(-1), np.int64(0), 0
    first = _FINE >> 1  # of a spacing: from what is known to the first spike after it
    while at < n:
        stop, last = at + step, _FINE
        known = stop <= n
        end, ended = np.int64(cycles), course[-1] << ONE
        if known:
            end = peek16(o, stop)
            ended = spikes_up_to(course, end, cycles)
        else:
            stop, last = n + 1, _FINE >> 1
            if not at:
                first, last = phase, _FINE - phase
        span = first + _FINE * (stop - at - 2) + last
        for i in range(at + 1, stop):
            place = begun + (ended - begun) * (first + _FINE * (i - at - 1)) // span
            t = time_of(course, place, cycles)
            before = min(max(t, before + 1), end - (stop - i))
            poke16(o, i, before)
        before, begun, first = end, ended, _FINE
        at = stop


@njit(cache=True, nogil=True)
def draw_spikes(times, starts, words):  # type: ignore[no-untyped-def]
    """Sets the bits of the spikes in (n, h, w) uint32 words, zeros at first."""
    pixel = 0
    for y in range(words.shape[1]):
        for x in range(words.shape[2]):
            for j in range(starts[pixel], starts[pixel + 1]):
                t = np.int64(times[j])
                words[t >> 5, y, x] |= np.uint32(1 << (t & 31))
            pixel += 1


def steady(counts: npt.NDArray[np.int32], over: int, cycles: int) -> Words:
    """(n, h, w) words of `cycles` cycles with the rates of (h, w) `counts` in `over` cycles."""
    words: Words = np.zeros((words_for(cycles), *counts.shape), np.uint32)
    spikes = (counts.astype(np.int64) * cycles + over // 2) // over
    starts = np.zeros(counts.size + 1, np.int32)
    np.cumsum(spikes, out=starts[1:])
    times = np.zeros(int(starts[-1]) + 1, np.int16)
    course, changes = course_of(even_spans(counts.shape, cycles), cycles)
    fill_times(times, starts, course, changes, counts.shape[1], _NONE, cycles)
    draw_spikes(times, starts, words)
    return words
