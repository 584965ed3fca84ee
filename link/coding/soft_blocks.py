"""Blocks of words with soft decisions: scrambled symbols carry the bits of LDPC codewords.

Symbol k of the cells carries bit k of their values, so a block is a row of bits, one cell after
another, one symbol after another. Words are as long as the code of a full graph of the mode's rate,
or shortened until whole words fill the block. A small panel has shorter words, or several groups to
a word. With interleaving, bit b of word w is at place w + p(b) words of the row, p a permutation
that keeps neighbours apart: a small obstacle before the panel takes a few bits of every word, and a
wide one bits of all columns of the graph, which could not find two whole columns.

The loops from the soft values of cells to those of words, and from decoded words back to the bits
that were wrong, are compiled.
"""

from __future__ import annotations

from functools import cached_property
from math import gcd
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from link.coding.blocks import Blocks
from link.coding.ldpc import STEPS, Ldpc
from link.coding.ldpc_decoding import SOFT
from link.layout import PERIOD

_Bytes = npt.NDArray[np.uint8]
_Soft = npt.NDArray[np.int8]
_U64 = np.uint64
_SIGNS, _REST = _U64(0x8080808080808080), _U64(0x7F7F7F7F7F7F7F7F)
_TOGETHER: Final = _U64(0x0102040810204080)
"""Factor that brings the lowest bits of eight bytes together in the highest byte."""
_FOURS, _TWOS, _ONES = _U64(0xFFFFFFFF), _U64(0x0000FFFF0000FFFF), _U64(0x00FF00FF00FF00FF)
"""Every other four bytes, two bytes and byte."""
_LEAST: Final = 4096
"""Bits of a word at least. Shorter ones need more information of a bit."""
_GOLDEN: Final = (5**0.5 - 1) / 2
"""Share of a word between neighbours: multiples of it, modulo 1, are far from each other."""


class SoftBlocks(Blocks):
    """Blocks of one layout, of a mode with a rate; see `Blocks`."""

    most_words: ClassVar[int] = 2
    least_bits: ClassVar[int] = _LEAST

    @cached_property
    def groups(self) -> int:
        """Groups in a block. Whole blocks fill the period of the pilots."""
        least, turn = -(-self.least_bits // self._group_bits), PERIOD // self.layout.group
        return next(n for n in range(least, PERIOD * least) if n >= turn or turn % n == 0)

    @property
    def _group_bits(self) -> int:
        return self.layout.group * self.layout.cells

    @cached_property
    def code(self) -> Ldpc:
        """The code of the words."""
        rate = self.layout.mode.rate
        assert rate is not None
        bits = self.groups * self._group_bits
        longest = Ldpc.of_rate(rate).word_bits
        words = -(-bits // longest)
        word_bits = bits // words // 8 * 8
        return Ldpc(int(word_bits * rate) // 8 * 8, word_bits)

    @property
    def word_bytes(self) -> int:
        return self.code.word_bits // 8

    @property
    def data_bytes(self) -> int:
        return self.code.data_bits // 8

    @cached_property
    def order(self) -> npt.NDArray[np.intp]:
        """p(b) of each bit of a word, (word bits,)."""
        size = self.code.word_bits
        return np.arange(size) * self._golden(size) % size

    @staticmethod
    def _golden(size: int) -> int:
        """A step whose multiples, modulo `size`, are all numbers, far from each other."""
        return next(n for n in range(round(_GOLDEN * size), 2 * size) if gcd(n, size) == 1)

    def lay(self, words: _Bytes, block: int) -> _Bytes:
        """Values of the cells, (groups, cells) uint8, for words (words, word bytes).

        Unused places carry the keystream.
        """
        return self._values(self._row(words), block)

    def _row(self, words: _Bytes) -> _Bytes:
        """Bits of a block without the keystream, (groups, symbols, cells) uint8."""
        row = np.zeros((self.groups, self.layout.group, self.layout.cells), np.uint8)
        self._put(np.unpackbits(words, axis=1, bitorder="little"), row)
        return row

    def _values(self, row: _Bytes, block: int) -> _Bytes:
        """Values of the cells for the bits of a block."""
        out = np.packbits(row, axis=1, bitorder="little")[:, 0]
        for n, values in enumerate(out):
            values ^= self.keystream(block * self.groups + n)[: self.layout.cells]
        return out

    def _put(self, words: npt.NDArray[np.integer], row: npt.NDArray[np.integer]) -> None:
        """Fills the row with words, (words, word bits)."""
        used = row.reshape(-1)[: words.size]
        if self.interleave:
            used.reshape(-1, self.words)[self.order] = words.T
        else:
            used[:] = words.reshape(-1)

    def store(self, soft: npt.NDArray[np.float32], group: int, out: _Soft) -> None:
        """Fills out, (symbols, cells) int8, with the soft values of a group in steps
        (`link.coding.ldpc.quantise`), without the keystream."""
        stream = self.keystream(group)
        by_rows(
            _store_group, out.shape[1], np.ascontiguousarray(soft), stream, np.float32(STEPS),
            np.float32(SOFT), out,
        )  # fmt: skip

    def collect(self, row: _Soft) -> _Soft:
        """Soft values of the words, (words, word_bits), from those of a block without the
        keystream, (groups, symbols, cells): the inverse of `lay`."""
        used = row.reshape(-1)[: self.words * self.code.word_bits]
        if not self.interleave:
            return used.reshape(self.words, -1)
        out = np.empty((self.words, self.code.word_bits), np.int8)
        eights = out.view(np.uint64)
        by_rows(gather_words, eights.shape[1], used.reshape(-1, self.words), self.order, eights)
        return out

    def bits_of(self, marked: _Bytes) -> _Bytes:
        """Marked bits of words, (words, word bytes) uint8, at their cells: (groups, symbols, cells)
        uint8."""
        return self._row(marked)

    def cells_of(self, wrong: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Number of marked bits, (words, word bytes) uint8, on each data cell."""
        out = np.zeros(self.layout.cells, np.int64)
        order = self.order if self.interleave else self.order[:0]
        count_by_cell(wrong, order, self.words, out)
        return out


@njit(cache=True, nogil=True)
def _store(soft, stream, bit, steps, most, out):  # type: ignore[no-untyped-def]
    """Fills out, (n,) int8, with soft values in steps, their sign turned where the keystream's bit
    is 1; NaN as 0."""
    for c in range(len(out)):
        value = soft[c] * steps
        value = value if value == value else np.float32(0)
        turn = np.float32(1 - 2 * ((stream[c] >> bit) & 1))
        out[c] = np.int8(np.rint(min(max(value, -most), most) * turn))


@njit(cache=True, nogil=True)
def _store_group(cell0, cell1, soft, stream, steps, most, out):  # type: ignore[no-untyped-def]
    """Quantises the soft values of a group's cells and takes their keystream off.

    Args:
        soft: (symbols, cells) float32.
        stream: (cells,) uint8, the keystream.
        steps: number of steps in a unit of the soft values.
        most: largest number of steps.
        out: (symbols, cells) int8, filled.
    """
    stream = stream[cell0:cell1]
    for s in range(soft.shape[0]):
        _store(soft[s, cell0:cell1], stream, s, steps, most, out[s, cell0:cell1])


@njit(cache=True, nogil=True)
def _copy(source, target):  # type: ignore[no-untyped-def]
    for i in range(len(source)):
        target[i] = source[i]


@njit(cache=True, nogil=True, inline="always")
def _swap(a, b, bits, low):  # type: ignore[no-untyped-def]
    """Exchanges the high pieces of a, `bits` wide, and the low pieces of b; `low` marks these."""
    return (a & low) | ((b & low) << bits), ((a >> bits) & low) | (b & ~low)


@njit(cache=True, nogil=True)
def _turn(rows, words, byte, out):  # type: ignore[no-untyped-def]
    """Fills out[w, byte], (words, n) uint64, with byte w of each of eight rows.

    rows: (8, words / 8 or more) uint64. Eight by eight bytes are transposed at a time, as four, two
    and one (Warren, Hacker's Delight, section 7-3).
    """
    for n in range(-(-words // 8)):
        a, b, c, d = rows[0, n], rows[1, n], rows[2, n], rows[3, n]
        e, f, g, h = rows[4, n], rows[5, n], rows[6, n], rows[7, n]
        a, e = _swap(a, e, _U64(32), _FOURS)
        b, f = _swap(b, f, _U64(32), _FOURS)
        c, g = _swap(c, g, _U64(32), _FOURS)
        d, h = _swap(d, h, _U64(32), _FOURS)
        a, c = _swap(a, c, _U64(16), _TWOS)
        b, d = _swap(b, d, _U64(16), _TWOS)
        e, g = _swap(e, g, _U64(16), _TWOS)
        f, h = _swap(f, h, _U64(16), _TWOS)
        a, b = _swap(a, b, _U64(8), _ONES)
        c, d = _swap(c, d, _U64(8), _ONES)
        e, f = _swap(e, f, _U64(8), _ONES)
        g, h = _swap(g, h, _U64(8), _ONES)
        w = 8 * n
        if w + 8 <= words:
            out[w, byte], out[w + 1, byte], out[w + 2, byte], out[w + 3, byte] = a, b, c, d
            out[w + 4, byte], out[w + 5, byte], out[w + 6, byte], out[w + 7, byte] = e, f, g, h
        else:
            for i, value in enumerate((a, b, c, d, e, f, g)):
                if w + i < words:
                    out[w + i, byte] = value


@njit(cache=True, nogil=True)
def gather_words(byte0, byte1, row, order, out):  # type: ignore[no-untyped-def]
    """Fills bytes of out, (words, word bits / 8) uint64, with the bits of words, eight bits' int8
    each.

    Args:
        row: (word bits, words) int8.
        order: (word bits,) p(b).
    """
    words = len(out)
    held = np.zeros((8, -(-words // 8) * 8), np.int8)
    for byte in range(byte0, byte1):
        for i in range(8):
            _copy(row[order[8 * byte + i]], held[i])
        _turn(held.view(np.uint64), words, byte, out)


@njit(cache=True, nogil=True)
def mark_changed(w0, w1, soft, sent, ok, out):  # type: ignore[no-untyped-def]
    """Marks the decisions that differ from the words as sent. A bit without a soft value was not
    decided.

    Args:
        soft: (words, word bits) uint64, eight bits' int8 each.
        sent: (words, word bytes) uint8.
        ok: (words,) bool, false for words of which nothing is marked.
        out: (words, word bytes) uint8, filled; bit b of a word is bit b % 8 of byte b // 8.
    """
    for w in range(w0, w1):
        if not ok[w]:
            out[w] = 0
            continue
        for i in range(sent.shape[1]):
            eight = soft[w, i]
            some = (((eight & _REST) + _REST) | eight) & _SIGNS
            on = some & ~eight
            decided = ((some >> _U64(7)) * _TOGETHER) >> _U64(56)
            ones = ((on >> _U64(7)) * _TOGETHER) >> _U64(56)
            out[w, i] = (ones ^ _U64(sent[w, i])) & decided


@njit(cache=True, nogil=True)
def count_by_cell(marked, order, words, out):  # type: ignore[no-untyped-def]
    """Adds the number of marked bits, few of many, to their cells.

    Args:
        marked: (words, word bytes) uint8, as `mark_changed` fills it.
        order: (word bits,) p(b), or empty if the words follow one another.
        words: number of words.
        out: (cells,) int64.
    """
    cells, size = len(out), 8 * marked.shape[1]
    for w in range(words):
        for i in range(marked.shape[1]):
            byte = marked[w, i]
            if byte == 0:
                continue
            for j in range(8):
                if (byte >> j) & 1:
                    b = 8 * i + j
                    place = order[b] * words + w if len(order) else w * size + b
                    out[place % cells] += 1
