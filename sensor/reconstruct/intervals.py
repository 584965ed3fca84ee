"""TFI, texture from inter-spike intervals: 1/ISI of the interval that holds the instant (Zhu et
al., ICME 2019; Huang 2022 section 3.3.2), and the paper's own rendering of it, 255 - tau.

A spike latched in cycle c ends the interval that gathered its charge, so the interval that holds
cycle n runs from the last spike before n (excluded) to the first spike at or after n.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, SpikeStream, Words, words_for
from sensor.reconstruct.playback import check_cycle

__all__ = [
    "interval_image",
    "interval_rate",
    "isi",
    "least_width",
    "spike_cycles",
    "tau_image",
    "tau_levels",
    "tfi",
]

_NONE = -1
WHITEST: Final = 255
Cycles = npt.NDArray[np.int64]


def _lowest(word: npt.NDArray[np.uint32]) -> Cycles:
    """Index of the lowest set bit of each (non-zero) word."""
    return np.bitwise_count((word & (~word + np.uint32(1))) - np.uint32(1)).astype(np.int64)


def _highest(word: npt.NDArray[np.uint32]) -> Cycles:
    """Index of the highest set bit of each (non-zero) word."""
    return np.frexp(word.astype(np.float64))[1].astype(np.int64) - 1


def _at_or_after(stream: SpikeStream, cycles: Cycles) -> Cycles:
    """First spike at or after each pixel's cycle, -1 where there is none. cycles: (n,) all
    pixels."""
    cycle = np.full(cycles.shape, _NONE, np.int64)
    start = cycles // WORD
    for w in range(int(start.min()), words_for(stream.cycles)):
        here = np.flatnonzero((cycle == _NONE) & (start <= w))
        if here.size == 0:
            if (cycle != _NONE).all():
                break
            continue
        word = _row(stream, w, here)
        low = np.where(start[here] == w, cycles[here] % WORD, 0).astype(np.uint32)
        word &= np.uint32(0xFFFFFFFF) << low
        hit = word != 0
        cycle[here[hit]] = w * WORD + _lowest(word[hit])
    return cycle


def _before(stream: SpikeStream, cycles: Cycles) -> Cycles:
    """Last spike before each pixel's cycle, -1 where there is none. cycles: (n,) all pixels."""
    cycle = np.full(cycles.shape, _NONE, np.int64)
    start = (cycles - 1) // WORD
    for w in range(int(start.max()), -1, -1):
        here = np.flatnonzero((cycle == _NONE) & (start >= w))
        if here.size == 0:
            if (cycle != _NONE).all():
                break
            continue
        word = _row(stream, w, here)
        drop = np.where(start[here] == w, WORD - 1 - (cycles[here] - 1) % WORD, 0).astype(np.uint32)
        word &= np.uint32(0xFFFFFFFF) >> drop
        hit = word != 0
        cycle[here[hit]] = w * WORD + _highest(word[hit])
    return cycle


def _row(stream: SpikeStream, w: int, pixels: npt.NDArray[np.intp]) -> npt.NDArray[np.uint32]:
    words: Words = stream.read_words(w, w + 1)
    return words.reshape(-1)[pixels]


def interval_image(stream: SpikeStream, at: int) -> tuple[Cycles, Cycles]:
    """Spikes that begin and end the interval holding cycle `at`: two (H, W) int64 of cycles.

    Before a pixel's first spike or after its last one no whole interval holds the instant: the
    nearest whole one is given. A pixel with fewer than two spikes has none: (-1, -1).
    """
    check_cycle(stream, at)
    n = stream.shape[0] * stream.shape[1]
    instant = np.full(n, at, np.int64)
    begin, end = _before(stream, instant), _at_or_after(stream, instant)
    open_begin, open_end = begin == _NONE, end == _NONE
    if (open_begin & ~open_end).any():
        # The nearest whole interval starts with the first spike.
        following = _at_or_after(stream, np.where(open_begin & ~open_end, end + 1, stream.cycles))
        begin, end = (
            np.where(open_begin & ~open_end, end, begin),
            np.where(open_begin & ~open_end, following, end),
        )
    if (open_end & ~open_begin).any():
        preceding = _before(stream, np.where(open_end & ~open_begin, begin, 0))
        end, begin = (
            np.where(open_end & ~open_begin, begin, end),
            np.where(open_end & ~open_begin, preceding, begin),
        )
    whole = (begin != _NONE) & (end != _NONE)
    begin, end = np.where(whole, begin, _NONE), np.where(whole, end, _NONE)
    return begin.reshape(stream.shape), end.reshape(stream.shape)


def least_width(stream: SpikeStream, at: int) -> Cycles:
    """Cycles that the interval holding cycle `at` lasts at least, (H, W): its length, or the part
    of it that the stream holds."""
    check_cycle(stream, at)
    instant = np.full(stream.shape[0] * stream.shape[1], at, np.int64)
    begin, end = _before(stream, instant), _at_or_after(stream, instant)
    return (np.where(end == _NONE, stream.cycles, end) - begin).reshape(stream.shape)


def isi(stream: SpikeStream, at: int) -> Cycles:
    """Length in cycles of the interval that holds cycle `at`; 0 where a pixel has none."""
    begin, end = interval_image(stream, at)
    return end - begin


def tfi(stream: SpikeStream, at: int) -> npt.NDArray[np.float32]:
    """1/ISI at cycle `at`: (H, W) float32, spikes a cycle; 0 where a pixel has no interval."""
    return interval_rate(isi(stream, at))


def interval_rate(tau: Cycles) -> npt.NDArray[np.float32]:
    """Spikes a cycle of intervals of `tau` cycles; 0 where there is none."""
    return np.where(tau > 0, 1 / np.maximum(tau, 1), 0).astype(np.float32)


def tau_image(stream: SpikeStream, at: int, longest: int | None = WHITEST) -> npt.NDArray[np.uint8]:
    """255 - tau, tau normalised to [0, 255]: (H, W) uint8 (Huang 2022, figure 4b). The arguments
    are those of `tau_levels`."""
    return tau_levels(isi(stream, at), longest)


def tau_levels(tau: Cycles, longest: int | None = WHITEST) -> npt.NDArray[np.uint8]:
    """255 - 255 tau/longest of intervals of `tau` cycles, rounded; 0 for longer ones and where
    there is none.

    longest: cycles that become black. With 255, tau is only clipped. None is the longest interval
    of the image, so that all intervals are normalised.
    """
    most = max(int(tau.max(initial=0)), 1) if longest is None else longest
    level = WHITEST - np.rint(np.minimum(tau, most) * (WHITEST / most))
    return np.where(tau > 0, level, 0).astype(np.uint8)


def spike_cycles(
    stream: SpikeStream, pixels: Sequence[tuple[int, int]]
) -> list[npt.NDArray[np.int64]]:
    """Cycles in which the flag of each (row, column) is set, ascending; the stream is read once."""
    rows, columns = (np.array(x) for x in zip(*pixels, strict=True))
    words = np.concatenate(
        [stream.read_words(w, w + 1)[:, rows, columns] for w in range(words_for(stream.cycles))]
    )
    octets = np.ascontiguousarray(words.T).astype("<u4").view(np.uint8)
    bits = np.unpackbits(octets, axis=1, count=stream.cycles, bitorder="little")
    return [np.flatnonzero(row) for row in bits]
