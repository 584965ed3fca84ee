"""When in a packet the spikes of a block come, compiled: halves of its cycles that differ.

The cycles of a packet are a binary tree whose leaves are words of 32. At each node, one decision
says whether a block of 8 x 8 pixels is split in two halves of its cycles. If so, each of its blocks
of 4 x 4 codes how many of its spikes are in the first half, beside an even share. Steady light is
not split, and takes one decision. Where an edge moves, the halves place it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import WORD, Words, words_for
from sensor.codec.packets.counts import SUM_CONTEXTS
from sensor.codec.packets.midpoints import SCALE, SPAN_LEVEL, WINDOW
from sensor.codec.packets.ranges import NUMBER, decode_bit, get_number, poke16, put_number

_SIDE = 1 << SPAN_LEVEL
_NODES = 16
"""Nodes that can be split, from 1 on: 512 cycles are 16 words."""
_CLASSES = 8
_NUMBERS = SUM_CONTEXTS + 4 * 3
"""First context of the numbers; those of the sums stand first, then those of the decisions."""
SPAN_CONTEXTS = _NUMBERS + 3 * _CLASSES * NUMBER
_WORTH = 8
"""A block is split where the squared deviation from even shares, a pixel, exceeds this: noise has
less than 1 (the latch: 1/6 for each of the four blocks, and shot noise)."""
Spans = npt.NDArray[np.int32]


def spans_of(words: Words) -> Spans:
    """Spikes of blocks of 4 x 4 in each word, (n, rows, columns), of (n, h, w) words."""
    n, height, width = words.shape
    spans = np.zeros((n, -(-height // _SIDE), -(-width // _SIDE)), np.int32)
    _sum_blocks(words, spans)
    return spans


def even_spans(shape: tuple[int, ...], cycles: int) -> Spans:
    """The spans of steady light of one spike a cycle and block, of (h, w) pixels."""
    words = np.diff(np.minimum(WORD * np.arange(words_for(cycles) + 1), cycles))
    blocks = [-(-n // _SIDE) for n in shape]
    return np.broadcast_to(words[:, None, None], (len(words), *blocks)).astype(np.int32)


@njit(cache=True, nogil=True)
def _sum_blocks(words, spans):  # type: ignore[no-untyped-def]
    """Adds the spikes of words to those of their blocks."""
    for w in range(words.shape[0]):
        for y in range(words.shape[1]):
            for x in range(words.shape[2]):
                v = words[w, y, x]
                v -= (v >> np.uint32(1)) & np.uint32(0x55555555)
                v = (v & np.uint32(0x33333333)) + ((v >> np.uint32(2)) & np.uint32(0x33333333))
                v = (v + (v >> np.uint32(4))) & np.uint32(0x0F0F0F0F)
                v = ((v * np.uint32(0x01010101)) >> np.uint32(24)) & np.uint32(0x3F)
                spans[w, y >> SPAN_LEVEL, x >> SPAN_LEVEL] += np.int32(v)


@njit(cache=True, nogil=True, inline="always")
def _cycles(begin, end, cycles):  # type: ignore[no-untyped-def]
    """Cycles of words `begin` to `end` of a packet."""
    return min(WORD * end, cycles) - WORD * begin


@njit(cache=True, nogil=True, inline="always")
def _flag(split, v, u, node):  # type: ignore[no-untyped-def]
    """Context of the decision of block (v, u): depth, and how many of the two before are split."""
    depth = (node >= 2) + (node >= 4) + (node >= 8)
    return SUM_CONTEXTS + 3 * depth + split[v + 1, u, node] + split[v, u + 1, node]


@njit(cache=True, nogil=True)
def _number(sums, y, x, span, cycles):  # type: ignore[no-untyped-def]
    """Contexts of a first half: size and sign of the step between the blocks on both sides."""
    own = np.int64(sums[y, x])
    left = np.int64(sums[y, x - 1]) if x else own
    right = np.int64(sums[y, x + 1]) if x + 1 < sums.shape[1] else own
    above = np.int64(sums[y - 1, x]) if y else own
    below = np.int64(sums[y + 1, x]) if y + 1 < sums.shape[0] else own
    across, down = right - left, below - above
    step, size = (abs(across) + abs(down)) * span // cycles, 0
    while step > 3 and size < _CLASSES - 1:
        step >>= 1
        size += 1
    rises = (across if abs(across) >= abs(down) else down) > 0
    side = 0 if size == 0 else (1 if rises else 2)
    return _NUMBERS + (side * _CLASSES + size) * NUMBER


@njit(cache=True, nogil=True)
def _halves(spans, y, x, begin, middle, end):  # type: ignore[no-untyped-def]
    """(spikes of words `begin` to `end`, those before `middle`) of a block."""
    whole = first = np.int64(0)
    for w in range(begin, end):
        whole += spans[w, y, x]
        if w < middle:
            first += spans[w, y, x]
    return whole, first


@njit(cache=True, nogil=True)
def _even_out(spans, y, x, begin, end, whole, cycles):  # type: ignore[no-untyped-def]
    """Spreads the spikes of a block over its words `begin` to `end`."""
    span, before = _cycles(begin, end, cycles), 0
    for w in range(begin, end):
        upto = whole * _cycles(begin, w + 1, cycles) // span
        spans[w, y, x] = upto - before
        before = upto


@njit(cache=True, nogil=True, inline="always")
def _share(whole, one, span):  # type: ignore[no-untyped-def]
    """Spikes expected in `one` of `span` cycles."""
    return (whole * one + span // 2) // span


@njit(cache=True, nogil=True)
def _weighed(squared, span):  # type: ignore[no-untyped-def]
    """Squared error of counts in windows, summed over `span` cycles, of a squared deviation in its
    middle: the count up to a cycle is wrong by a triangle, as in `midpoints`."""
    if span * span < 6 * WINDOW * WINDOW:
        return 2 * squared * span // 3
    return 4 * squared * WINDOW * WINDOW // span


@njit(cache=True, nogil=True)
def put_spans(spans, sums, height, width, cycles, decisions, m):  # type: ignore[no-untyped-def]
    """Appends the decisions of the halves of all blocks; (their number, gain).

    spans: of `spans_of`; becomes what a decoder has. sums: of the same blocks in the whole packet.
    The gain is the squared error of counts in windows that the halves take away, summed over
    pixels and cycles, times SCALE.
    """
    out, gain = np.int64(decisions.ctypes.data), 0
    rows, columns = (sums.shape[0] + 1) >> 1, (sums.shape[1] + 1) >> 1
    split = np.zeros((rows + 1, columns + 1, _NODES), np.uint8)
    begins, ends = np.zeros(2 * _NODES, np.int64), np.zeros(2 * _NODES, np.int64)
    for v in range(rows):
        for u in range(columns):
            begins[1], ends[1:] = 0, 0
            ends[1] = spans.shape[0]
            for node in range(1, _NODES):
                begin, end = begins[node], ends[node]
                if end - begin < 2:
                    continue
                middle = (begin + end + 1) >> 1
                one, span = _cycles(begin, middle, cycles), _cycles(begin, end, cycles)
                off = 0
                for y in range(2 * v, min(2 * v + 2, sums.shape[0])):
                    for x in range(2 * u, min(2 * u + 2, sums.shape[1])):
                        whole, first = _halves(spans, y, x, begin, middle, end)
                        d = first * span - whole * one
                        area = min(_SIDE, height - _SIDE * y) * min(_SIDE, width - _SIDE * x)
                        off += SCALE * d // span * d // (span * area)
                flag = np.uint8(off > _WORTH * SCALE)
                poke16(out, m, (_flag(split, v, u, node) << 1) | flag)
                m += 1
                split[v + 1, u + 1, node] = flag
                if not flag:
                    for y in range(2 * v, min(2 * v + 2, sums.shape[0])):
                        for x in range(2 * u, min(2 * u + 2, sums.shape[1])):
                            whole, _ = _halves(spans, y, x, begin, middle, end)
                            _even_out(spans, y, x, begin, end, whole, cycles)
                    continue
                gain += _weighed(off, span)
                for y in range(2 * v, min(2 * v + 2, sums.shape[0])):
                    for x in range(2 * u, min(2 * u + 2, sums.shape[1])):
                        whole, first = _halves(spans, y, x, begin, middle, end)
                        if whole:
                            kind = _number(sums, y, x, span, cycles)
                            m = put_number(out, m, kind, first - _share(whole, one, span))
                begins[2 * node], ends[2 * node] = begin, middle
                begins[2 * node + 1], ends[2 * node + 1] = middle, end
    return m, gain


@njit(cache=True, nogil=True)
def get_spans(words, model, reader, sums, cycles, spans):  # type: ignore[no-untyped-def]
    """Fills in the spikes of each block and word, evenly where it is not split; whether they can
    be.

    words, model, reader: as of `get_parts`. sums: of the whole packet. spans: (n, rows, columns).
    """
    code, low, at = reader[0], reader[1], np.int64(reader[2])
    data, states = np.int64(words.ctypes.data), np.int64(model.ctypes.data)
    rows, columns = (sums.shape[0] + 1) >> 1, (sums.shape[1] + 1) >> 1
    split = np.zeros((rows + 1, columns + 1, _NODES), np.uint8)
    begins, ends = np.zeros(2 * _NODES, np.int64), np.zeros(2 * _NODES, np.int64)
    wholes = np.zeros((2 * _NODES, 2, 2), np.int64)
    for v in range(rows):
        for u in range(columns):
            begins[1], ends[1:] = 0, 0
            ends[1] = spans.shape[0]
            for node in range(1, 2 * _NODES):
                begin, end, flag = begins[node], ends[node], np.int64(0)
                if begin == end:
                    continue
                if end - begin > 1:
                    flag, code, low, at = decode_bit(
                        data, words.size, states, _flag(split, v, u, node), code, low, at
                    )
                    split[v + 1, u + 1, node] = flag
                middle = (begin + end + 1) >> 1
                one, span = _cycles(begin, middle, cycles), _cycles(begin, end, cycles)
                for y in range(2 * v, min(2 * v + 2, sums.shape[0])):
                    for x in range(2 * u, min(2 * u + 2, sums.shape[1])):
                        whole = wholes[node, y & 1, x & 1] if node > 1 else np.int64(sums[y, x])
                        if not flag:
                            _even_out(spans, y, x, begin, end, whole, cycles)
                            continue
                        first = np.int64(0)
                        if whole:
                            kind = _number(sums, y, x, span, cycles)
                            d, code, low, at = get_number(
                                data, words.size, states, kind, code, low, at
                            )
                            first = _share(whole, one, span) + d
                            if first < 0 or first > whole:
                                return False
                        wholes[2 * node, y & 1, x & 1] = first
                        wholes[2 * node + 1, y & 1, x & 1] = whole - first
                if flag:
                    begins[2 * node], ends[2 * node] = begin, middle
                    begins[2 * node + 1], ends[2 * node + 1] = middle, end
    reader[0], reader[1], reader[2] = code, low, np.uint64(at)
    return True
