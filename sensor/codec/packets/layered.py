"""The layered code: a tile's spikes from coarse to fine, each layer in a packet of its own.

layer  holds                                       a decoder that has no more
0      spikes of blocks of 8 x 8 pixels            spreads them over pixels and cycles
1      spikes of blocks of 4 x 4 and, where they   the same
       change, when; then of 2 x 2
2      spikes of pixels                            spreads them over the cycles, as their block
3      times of every 16th spike of a pixel        spreads those between evenly
4 - 6  times of every 8th, 4th, 2nd                the same
7      times of the others                         has the stream, bit by bit
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words, words_for
from sensor.codec.columns import Damaged
from sensor.codec.packets.counts import (
    MOST_PART,
    TOP,
    Sums,
    get_blocks,
    get_parts,
    put_blocks,
    put_parts,
    pyramid,
    spread,
)
from sensor.codec.packets.fill import draw_spikes, fill_times
from sensor.codec.packets.midpoints import (
    MOST_DECISIONS,
    SCALE,
    SPAN_LEVEL,
    TIME_CONTEXTS,
    WINDOW,
    course_of,
    find_spikes,
    get_times,
    put_times,
)
from sensor.codec.packets.packet import Layer
from sensor.codec.packets.ranges import FRESH, encode_bits, from_bytes, open_bits, to_bytes
from sensor.codec.packets.spans import (
    SPAN_CONTEXTS,
    even_spans,
    get_spans,
    put_spans,
    spans_of,
)

SUM_LAYERS: Final = ((), (3, 2), (1,))
"""Levels of sums that are split in layers 0 to 2."""
TIME_LAYERS: Final = ((8, 4), (3, 3), (2, 2), (1, 1), (0, 0))
"""Levels of times, from and to, in layers 3 to 7; no packet has 512 spikes before a 512th."""
LAYERS = len(SUM_LAYERS) + len(TIME_LAYERS)
Times = npt.NDArray[np.int16]


class _Coder:
    """Decisions of one tile to bytes, with room for all that its spikes may need."""

    def __init__(self, room: int, contexts: int) -> None:
        self.decisions = np.empty(room, np.uint16)
        self._out = np.empty(room // 2 + 4, np.uint32)
        self._model = np.empty(contexts, np.uint32)

    def code(self, count: int) -> bytes:
        self._model[:] = FRESH
        return to_bytes(self._out[: encode_bits(self.decisions, count, self._model, self._out)])


class Layered:
    """The code. layers: that are sent, 1 to LAYERS; all of them lose nothing."""

    def __init__(self, layers: int = LAYERS) -> None:
        if not 1 <= layers <= LAYERS:
            raise ValueError(f"layers must be 1 to {LAYERS}, not {layers}")
        self.layers = layers

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        n, height, width = words.shape
        times = np.empty(WORD * n * height * width, np.int16)
        starts = np.empty(height * width + 1, np.int32)
        find_spikes(words, times, starts)
        spans = spans_of(words)
        layers = _sums(np.diff(starts).reshape(height, width), spans, cycles)
        if self.layers > len(SUM_LAYERS):
            layers += _times(times, starts, *course_of(spans, cycles), width, cycles)
        return layers[: self.layers]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`."""
        words: Words = np.zeros((words_for(cycles), *shape), np.uint32)
        counts, spans = _read_sums(layers[: len(SUM_LAYERS)], shape, cycles)
        starts = np.zeros(counts.size + 1, np.int32)
        np.cumsum(counts, out=starts[1:])
        times = np.zeros(int(starts[-1]) + 1, np.int16)
        model, low = np.empty(TIME_CONTEXTS, np.uint32), TIME_LAYERS[0][0] + 1
        course, changes = course_of(spans, cycles)
        for data, (high, least) in zip(layers[len(SUM_LAYERS) :], TIME_LAYERS, strict=False):
            low, model[:] = least, FRESH
            if not get_times(
                from_bytes(data), model, starts, course, changes, shape[1], high, low, cycles, times
            ):
                raise Damaged("times that cannot be")
        if low:
            fill_times(times, starts, course, changes, shape[1], low, cycles)
        draw_spikes(times, starts, words)
        return words


def _sums(counts: Sums, spans: Sums, cycles: int) -> list[Layer]:
    """Layers 0 to 2 from the spikes of each pixel, (h, w), and those of `spans_of`, which become
    what a decoder has."""
    height, width = counts.shape
    levels = pyramid(counts)
    coder = _Coder(MOST_PART * (2 * counts.size + 64), SPAN_CONTEXTS)
    n = put_blocks(levels[TOP], height, width, cycles, coder.decisions)
    layers = [Layer(coder.code(n), 0, 0.0)]
    for splits in SUM_LAYERS[1:]:
        n, gain, later = 0, 0, 0
        for level in splits:
            if level == SPAN_LEVEL:
                n, later = put_spans(
                    spans, levels[level], height, width, cycles, coder.decisions, n
                )
            n, more = put_parts(
                levels[level], levels[level - 1], level, height, width, cycles, coder.decisions, n
            )
            gain += more
        worth = (gain * WINDOW**2 / cycles + later) / SCALE
        layers.append(Layer(coder.code(n), 0, worth))
    return layers


def _times(
    times: Times, starts: Sums, course: Any, changes: Any, width: int, cycles: int
) -> list[Layer]:
    """Layers 3 to 7 from spikes as `find_spikes` lists them, and `course_of` their blocks."""
    most = int(starts[-1]) // 2 + len(starts)  # half of them in one layer, and one of each pixel
    coder = _Coder(MOST_DECISIONS * most, TIME_CONTEXTS)
    layers = []
    for high, low in TIME_LAYERS:
        n, spikes, gain = put_times(
            times, starts, course, changes, width, high, low, cycles, coder.decisions
        )
        layers.append(Layer(coder.code(n), spikes, gain / SCALE))
    return layers


def _read_sums(layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> tuple[Sums, Sums]:
    """Spikes of each pixel, (h, w), and of `spans_of`, both even where they are not known."""
    model = np.full(SPAN_CONTEXTS, FRESH, np.uint32)
    spans = even_spans(shape, cycles)
    sums: npt.NDArray[np.int32] = np.zeros([-(-n >> TOP) for n in shape], np.int32)
    if not get_blocks(from_bytes(layers[0]), model, *shape, cycles, sums):
        raise Damaged("sums that cannot be")
    for data, splits in zip(layers[1:], SUM_LAYERS[1:], strict=False):
        words, model[:] = from_bytes(data), FRESH
        reader = np.array(open_bits(words), np.uint64)
        for level in splits:
            if level == SPAN_LEVEL and not get_spans(words, model, reader, sums, cycles, spans):
                raise Damaged("spans that cannot be")
            parts = np.zeros([-(-n >> (level - 1)) for n in shape], np.int32)
            if not get_parts(words, model, reader, sums, parts, level, *shape, cycles):
                raise Damaged("sums that cannot be")
            sums = parts
    return spread(sums, shape), spans
