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
from numba import njit

from cosim.spikes.viform import WORD, SpikeStream, words_for
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


@njit(cache=True, nogil=True)
def _first_from(word, begin, cycles, found):  # type: ignore[no-untyped-def]
    """Enters the first spike at or after each pixel's cycle that a word from `begin` on has; the
    number of pixels that still lack one. found: (n,), _NONE at first."""
    lacking = 0
    for p in range(word.size):
        if found[p] != _NONE:
            continue
        skip = min(max(cycles[p] - begin, 0), WORD)
        rest = np.uint64(word[p]) >> np.uint64(skip) << np.uint64(skip)
        if rest:
            n = 0
            while not (rest >> np.uint64(n)) & np.uint64(1):
                n += 1
            found[p] = begin + n
        else:
            lacking += 1
    return lacking


@njit(cache=True, nogil=True)
def _last_before(word, begin, cycles, found):  # type: ignore[no-untyped-def]
    """The same of the last spike before each pixel's cycle."""
    lacking = 0
    for p in range(word.size):
        if found[p] != _NONE:
            continue
        kept = min(max(cycles[p] - begin, 0), WORD)
        rest = np.uint64(word[p]) & ((np.uint64(1) << np.uint64(kept)) - np.uint64(1))
        if rest:
            n = kept - 1
            while not (rest >> np.uint64(n)) & np.uint64(1):
                n -= 1
            found[p] = begin + n
        else:
            lacking += 1
    return lacking


def _at_or_after(stream: SpikeStream, cycles: Cycles) -> Cycles:
    """First spike at or after each pixel's cycle, -1 where there is none. cycles: (n,) all
    pixels."""
    found = np.full(cycles.shape, _NONE, np.int64)
    for w in range(int(cycles.min()) // WORD, words_for(stream.cycles)):
        word = stream.read_words(w, w + 1).reshape(-1)
        if not _first_from(word, w * WORD, cycles, found):
            break
    return found


def _before(stream: SpikeStream, cycles: Cycles) -> Cycles:
    """Last spike before each pixel's cycle, -1 where there is none. cycles: (n,) all pixels."""
    found = np.full(cycles.shape, _NONE, np.int64)
    for w in range((int(cycles.max()) - 1) // WORD, -1, -1):
        word = stream.read_words(w, w + 1).reshape(-1)
        if not _last_before(word, w * WORD, cycles, found):
            break
    return found


def interval_image(
    stream: SpikeStream, at: int, within: tuple[int, int] | None = None
) -> tuple[Cycles, Cycles]:
    """Spikes that begin and end the interval holding cycle `at`: two (H, W) int64 of cycles.

    Before a pixel's first spike or after its last one no whole interval holds the instant: the
    nearest whole one is given. A pixel with fewer than two spikes has none: (-1, -1).
    within: (first, stop) cycles whose spikes count; None for all.
    """
    check_cycle(stream, at)
    n = stream.shape[0] * stream.shape[1]
    first, stop = (0, stream.cycles) if within is None else within

    def before(cycles: Cycles) -> Cycles:
        found = _before(stream, cycles)
        return np.where(found < first, _NONE, found)

    def from_on(cycles: Cycles) -> Cycles:
        found = _at_or_after(stream, cycles)
        return np.where(found >= stop, _NONE, found)

    instant = np.full(n, max(at, first), np.int64)
    begin, end = before(instant), from_on(instant)
    open_begin, open_end = begin == _NONE, end == _NONE
    if (open_begin & ~open_end).any():
        # The nearest whole interval starts with the first spike.
        following = from_on(np.where(open_begin & ~open_end, end + 1, stream.cycles))
        begin, end = (
            np.where(open_begin & ~open_end, end, begin),
            np.where(open_begin & ~open_end, following, end),
        )
    if (open_end & ~open_begin).any():
        preceding = before(np.where(open_end & ~open_begin, begin, 0))
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


def isi(stream: SpikeStream, at: int, within: tuple[int, int] | None = None) -> Cycles:
    """Length in cycles of the interval that holds cycle `at`; 0 where a pixel has none. within: as
    of `interval_image`."""
    begin, end = interval_image(stream, at, within)
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
    stream: SpikeStream,
    pixels: Sequence[tuple[int, int]],
    span: tuple[int, int] = (0, 2**62),
) -> list[npt.NDArray[np.int64]]:
    """Cycles of a span in which the flag of each (row, column) is set, ascending; the stream is
    read once. span: first cycle, and the one after the last."""
    rows, columns = (np.array(x) for x in zip(*pixels, strict=True))
    first, stop = max(span[0], 0), min(span[1], stream.cycles)
    if first >= stop:
        return [np.zeros(0, np.int64) for _ in pixels]
    begin = first // WORD
    words = np.concatenate(
        [stream.read_words(w, w + 1)[:, rows, columns] for w in range(begin, words_for(stop))]
    )
    octets = np.ascontiguousarray(words.T).astype("<u4").view(np.uint8)
    bits = np.unpackbits(octets, axis=1, bitorder="little")[:, : stop - begin * WORD]
    found = (np.flatnonzero(row) + begin * WORD for row in bits)
    return [cycles[cycles >= first] for cycles in found]
