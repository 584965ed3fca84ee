"""Blocks of words with soft decisions: scrambled symbols carry the bits of LDPC codewords.

Symbol k of the cells carries bit k of their values, so a block is a row of bits, one cell after
another, one symbol after another. Words are as long as the code of a full graph of the mode's rate,
or shortened until whole words fill the block. A small panel has shorter words, or several groups to
a word. With interleaving, bit b of word w is at place w + p(b) words of the row, p a permutation
that keeps neighbours apart: a small obstacle before the panel takes a few bits of every word, and a
wide one bits of all columns of the graph, which could not find two whole columns.
"""

from __future__ import annotations

from functools import cached_property
from math import gcd
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from link.coding.blocks import Blocks
from link.coding.ldpc import STEPS, Ldpc
from link.coding.ldpc_numpy import SOFT
from link.coding.soft_blocks_compiled import count_by_cell, gather_words, store_group
from link.layout import PERIOD

_LEAST: Final = 4096
"""Bits of a word at least. Shorter ones need more information of a bit."""
_GOLDEN: Final = (5**0.5 - 1) / 2
"""Share of a word between neighbours: multiples of it, modulo 1, are far from each other."""
_Bytes = npt.NDArray[np.uint8]
_Soft = npt.NDArray[np.int8]


class SoftBlocks(Blocks):
    """Blocks of one layout, of a mode with a rate; see `Blocks`."""

    most_words: ClassVar[int] = 2

    @cached_property
    def groups(self) -> int:
        """Groups in a block. Whole blocks fill the period of the pilots."""
        least, turn = -(-_LEAST // self._group_bits), PERIOD // self.layout.group
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
        store_group(np.ascontiguousarray(soft), stream, np.float32(STEPS), np.float32(SOFT), out)

    def collect(self, row: _Soft) -> _Soft:
        """Soft values of the words, (words, word_bits), from those of a block without the
        keystream, (groups, symbols, cells): the inverse of `lay`."""
        used = row.reshape(-1)[: self.words * self.code.word_bits]
        if not self.interleave:
            return used.reshape(self.words, -1)
        out = np.empty((self.words, self.code.word_bits), np.int8)
        gather_words(used.reshape(-1, self.words), self.order, out.view(np.uint64))
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
