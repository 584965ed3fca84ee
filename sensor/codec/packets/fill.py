"""Spikes that were not sent, spread evenly between those that were; and times as bits of words."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import Words, words_for
from sensor.codec.packets.memory import peek16, poke16
from sensor.codec.packets.midpoints import WINDOW

__all__ = ["draw_spikes", "fill_times", "steady"]

_NONE = 10
"""A level that no packet reaches."""
_SIDE = 8
"""Side of the matrix of phases, pixels; tiles are multiples of it."""


def _phases() -> npt.NDArray[np.int64]:
    """Phase of dim trains without a known spike, by row and column modulo _SIDE, in 1 / (2 _SIDE^2)
    of an interval: ordered dither (Bayer 1973). Equal trains of one phase would all fire at once,
    and a dim area would be dark in one window and bright in another. Brighter trains have spikes in
    every window, and one phase is nearer to the truth at both ends of a packet."""
    order = np.zeros((1, 1), np.int64)
    while len(order) < _SIDE:
        order = np.block([[4 * order, 4 * order + 2], [4 * order + 3, 4 * order + 1]])
    return 2 * order + 1


_PHASE = _phases()


@njit(cache=True, nogil=True)
def fill_times(times, starts, width, low, cycles):  # type: ignore[no-untyped-def]
    """Fills in the times of all levels below `low`; the others are known.

    Between two known spikes those of equal spacing, to the nearest cycle. The packet's ends stand
    half a spacing beyond the first and the last spike. A train of which no spike is known has equal
    spacing, and the phase of its pixel if its intervals are longer than WINDOW cycles.
    times, starts: as `find_spikes` makes them. width: of the tile, pixels.
    """
    step, fine = 1 << low, 2 * _SIDE * _SIDE
    base = np.int64(times.ctypes.data)
    for p in range(starts.size - 1):
        n = np.int64(starts[p + 1] - starts[p])
        o = base + 2 * (np.int64(starts[p]) - 1)
        if n < step:
            phase = fine >> 1
            if n * WINDOW < cycles:
                phase = _PHASE[p // width % _SIDE, p % width % _SIDE]
            for i in range(1, n + 1):
                poke16(o, i, cycles * (fine * (i - 1) + phase) // (fine * n))
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
    fill_times(times, starts, counts.shape[1], _NONE, cycles)
    draw_spikes(times, starts, words)
    return words
