"""TFI, texture from inter-spike intervals: 1/ISI of the interval that holds the instant (Zhu et
al., ICME 2019; Huang 2022 section 3.3.2), and the paper's own rendering of it, 255 - tau.

A spike latched in cycle c ends the interval that gathered its charge, so the interval that holds
cycle n runs from the last spike before n (excluded) to the first spike at or after n. If n itself
has a spike, two intervals meet there. By default it belongs to the one that this spike ends; with
ties "after", as in the field's public code, to the one that it begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import WORD, SpikeStream, words_for
from sensor.reconstruct.playback import check_cycle, tfp_span

Ties = Literal["before", "after"]
"""Interval of an instant that has a spike: the one that it ends, or the one that it begins."""
TIES: Final[tuple[Ties, ...]] = ("before", "after")
_NONE = -1
WHITEST: Final = 255
Cycles = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def _lowest(bits):  # type: ignore[no-untyped-def]
    """Place of the lowest set bit of a word that has one, by halves."""
    place = 0
    for half in (16, 8, 4, 2, 1):
        if not bits & ((np.uint32(1) << np.uint32(half)) - np.uint32(1)):
            bits >>= np.uint32(half)
            place += half
    return place


@njit(cache=True, nogil=True)
def _highest(bits):  # type: ignore[no-untyped-def]
    """Place of the highest set bit of a word that has one, by halves."""
    place = 0
    for half in (16, 8, 4, 2, 1):
        if bits >> np.uint32(half):
            bits >>= np.uint32(half)
            place += half
    return place


@njit(cache=True, nogil=True)
def _nearest(word, begin, cycles, after, found, lacking, count):  # type: ignore[no-untyped-def]
    """Enters the spike nearest to each pixel's cycle that a word from `begin` on has: the first at
    or after it, or the last before it. lacking: numbers of the `count` pixels that still lack one
    first, which the ones that remain replace. Returns how many remain. found: (n,), _NONE at
    first."""
    remain = 0
    for k in range(count):
        p = lacking[k]
        n = min(max(cycles[p] - begin, 0), WORD)
        before = np.uint32((np.uint64(1) << np.uint64(n)) - np.uint64(1))
        rest = np.uint32(word[p] & (~before if after else before))
        if rest:
            found[p] = begin + (_lowest(rest) if after else _highest(rest))
        else:
            lacking[remain] = p
            remain += 1
    return remain


def _search(stream: SpikeStream, cycles: Cycles, within: tuple[int, int], *, after: bool) -> Cycles:
    """First spike at or after each pixel's cycle, or last one before it; -1 where there is none in
    the cycles (first, stop) of `within`. cycles: (n,) all pixels."""
    first, stop = within[0], min(within[1], stream.cycles)
    found = np.full(cycles.shape, _NONE, np.int64)
    lacking, count = np.arange(cycles.size, dtype=np.int32), cycles.size
    words = (
        range(max(int(cycles.min()), first) // WORD, words_for(stop))
        if after
        else range((min(int(cycles.max()), stop) - 1) // WORD, first // WORD - 1, -1)
    )
    for w in words:
        word = stream.read_words(w, w + 1).reshape(-1)
        count = _nearest(word, w * WORD, cycles, after, found, lacking, count)
        if not count:
            break
    if first % WORD or stop < stream.cycles:  # the words at the ends of the span hold more
        found[(found < first) | (found >= stop)] = _NONE
    return found


def interval_image(
    stream: SpikeStream,
    at: int,
    within: tuple[int, int] | None = None,
    ties: Ties = "before",
) -> tuple[Cycles, Cycles]:
    """Spikes that begin and end the interval holding cycle `at`: two (H, W) int64 of cycles.

    Before a pixel's first spike or after its last one no whole interval holds the instant: the
    nearest whole one is given. A pixel with fewer than two spikes has none: (-1, -1).
    within: (first, stop) cycles whose spikes count; None for all. ties: of pixels that fire in
    cycle `at`.
    """
    check_cycle(stream, at)
    span = (0, stream.cycles) if within is None else within
    first = max(at + (ties == "after"), span[0])  # from here on, a spike ends the interval
    instant = np.full(stream.shape[0] * stream.shape[1], first, np.int64)
    begin, end = (_search(stream, instant, span, after=after) for after in (False, True))
    lacks_begin, lacks_end = begin == _NONE, end == _NONE
    if not lacks_begin.any() and not lacks_end.any():  # away from the ends, as a rule
        return begin.reshape(stream.shape), end.reshape(stream.shape)
    early, late = lacks_begin & ~lacks_end, lacks_end & ~lacks_begin
    if early.any():  # the nearest whole interval begins with the first spike
        following = _search(stream, np.where(early, end + 1, stream.cycles), span, after=True)
        begin, end = np.where(early, end, begin), np.where(early, following, end)
    if late.any():
        preceding = _search(stream, np.where(late, begin, 0), span, after=False)
        begin, end = np.where(late, preceding, begin), np.where(late, begin, end)
    whole = (begin != _NONE) & (end != _NONE)
    begin, end = np.where(whole, begin, _NONE), np.where(whole, end, _NONE)
    return begin.reshape(stream.shape), end.reshape(stream.shape)


def least_width(stream: SpikeStream, at: int) -> Cycles:
    """Cycles that the interval holding cycle `at` lasts at least, (H, W): its length, or the part
    of it that the stream holds."""
    check_cycle(stream, at)
    instant = np.full(stream.shape[0] * stream.shape[1], at, np.int64)
    span = (0, stream.cycles)
    begin, end = (_search(stream, instant, span, after=after) for after in (False, True))
    return (np.where(end == _NONE, stream.cycles, end) - begin).reshape(stream.shape)


def isi(
    stream: SpikeStream,
    at: int,
    within: tuple[int, int] | None = None,
    ties: Ties = "before",
) -> Cycles:
    """Length in cycles of the interval that holds cycle `at`; 0 where a pixel has none. within,
    ties: as of `interval_image`."""
    begin, end = interval_image(stream, at, within, ties)
    return end - begin


def tfi(
    stream: SpikeStream, at: int, window: int | None = None, *, preceding: bool = False,
    ties: Ties = "before",
) -> npt.NDArray[np.float32]:  # fmt: skip
    """1/ISI at cycle `at`: (H, W) float32, spikes a cycle; 0 where a pixel has no interval.

    Args:
        window: cycles, as of `tfp`, between whose spikes intervals are taken; None for all of the
            stream.
        preceding: no spike after cycle `at` is used: the last whole interval by then.
        ties: interval of a pixel that fires in cycle `at`, as of `interval_image`.
    """
    span = interval_span(stream, at, window, preceding=preceding)
    return interval_rate(isi(stream, at, span, ties))


def interval_span(
    stream: SpikeStream, at: int, window: int | None, *, preceding: bool
) -> tuple[int, int] | None:
    """First cycle, and the one after the last, of those between whose spikes `tfi` takes intervals;
    None for all."""
    if window is not None:
        return tfp_span(stream, at, window, preceding=preceding)
    return (0, at + 1) if preceding else None


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
