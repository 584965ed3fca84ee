"""Blocks: codewords that are on the panel at the same time, and the cells that carry their bytes.

Those here are of Reed-Solomon; blocks of soft decisions are `link.coding.soft_blocks`. A block is
one group of all data cells; on a small panel, whose group holds no codeword, as many groups as hold
one. With interleaving, byte b of codeword w is at place w + b words of the block, so
that an obstacle before the panel takes a few bytes of every codeword; without it, codewords follow
one another. All data are scrambled with a known keystream, so that cells switch on and off whatever
the bytes are, and a dark panel is not a codeword.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final, Protocol

import numpy as np
import numpy.typing as npt

from link.coding.reed_solomon import WORD_BYTES, ReedSolomon
from link.layout import Layout

FRAME_SPENT: Final = 19
"""Bytes of a frame that are not the file's: head, packet number, CRC (`link.coding.boxes`)."""
_ALIGNMENT: Final = 8
"""The size of the fountain's symbols is a multiple of it."""
_KEY: Final = 0x53435241
_Bytes = npt.NDArray[np.uint8]
_Qualities = npt.NDArray[np.float32]


class WordCode(Protocol):
    """A code of words."""

    def encode(self, data: npt.ArrayLike) -> _Bytes:
        """Words (words, word bytes) uint8 of data (words, data bytes) uint8."""
        ...


@dataclass(frozen=True)
class Blocks:
    """Blocks of one layout.

    Attributes:
        layout: layout of the cells.
        interleave: whether codewords are interleaved.
        period: groups after which the keystream repeats, so that a receiver that joins late needs
            the number of a group only modulo this; None if it never repeats.

    Raises:
        ValueError: if the panel has too few cells for a codeword.
    """

    layout: Layout
    interleave: bool = True
    period: int | None = None

    most_words: ClassVar[int] = 8
    """Largest number of codewords of a frame: one lost codeword loses the frame."""

    def __post_init__(self) -> None:
        if self.group_bytes < 1:
            raise ValueError(f"data cells must be 8 or more, not {self.layout.cells}")

    @cached_property
    def group_bytes(self) -> int:
        """Whole bytes in a group."""
        return self.layout.group_bytes(1)

    @cached_property
    def groups(self) -> int:
        """Groups in a block."""
        return max(1, -(-WORD_BYTES // self.group_bytes))

    @cached_property
    def code(self) -> WordCode:
        """The code of the words."""
        assert self.layout.mode.parity is not None
        return ReedSolomon(self.layout.mode.parity)

    @property
    def word_bytes(self) -> int:
        """Bytes of a codeword."""
        return WORD_BYTES

    @cached_property
    def words(self) -> int:
        """Codewords in a block."""
        return self.groups * self.group_bytes // self.word_bytes

    @property
    def data_bytes(self) -> int:
        """Data bytes of a codeword."""
        assert self.layout.mode.parity is not None
        return WORD_BYTES - self.layout.mode.parity

    def _symbol(self, words: int) -> int:
        return (words * self.data_bytes - FRAME_SPENT) // _ALIGNMENT * _ALIGNMENT

    @cached_property
    def frame_words(self) -> int:
        """Codewords in a frame: the number that leaves most of a block to the file."""
        counts = range(1, min(self.most_words, self.words) + 1)
        return max(counts, key=lambda n: self.words // n * self._symbol(n))

    @cached_property
    def frames(self) -> int:
        """Frames in a block."""
        return self.words // self.frame_words

    @cached_property
    def frame_bytes(self) -> int:
        """Bytes of a frame, before the code of the words."""
        return self.frame_words * self.data_bytes

    @cached_property
    def symbol_bytes(self) -> int:
        """Bytes of the fountain's symbol in a frame."""
        return self._symbol(self.frame_words)

    @cached_property
    def places(self) -> npt.NDArray[np.intp]:
        """Place in the block of each byte of each codeword, (words, 255)."""
        word, byte = np.arange(self.words)[:, None], np.arange(WORD_BYTES)
        return word + byte * self.words if self.interleave else word * WORD_BYTES + byte

    def lay(self, words: _Bytes, block: int) -> _Bytes:
        """Values of the cells, (groups, cells) uint8, for codewords (words, 255).

        Unused places and cells carry the keystream.
        """
        placed = np.zeros(self.groups * self.group_bytes, np.uint8)
        placed[self.places] = words
        out = np.empty((self.groups, self.layout.cells), np.uint8)
        for n, row in enumerate(placed.reshape(self.groups, -1)):
            stream = self.keystream(block * self.groups + n)
            stream[: self.group_bytes] ^= row
            out[n] = _values(stream, self.layout.mode.code.bits)[: self.layout.cells]
        return out

    def gather(self, values: _Bytes, quality: _Qualities, block: int) -> tuple[_Bytes, _Qualities]:
        """Bytes of the codewords, (words, 255) uint8, and their qualities, float32.

        It is the inverse of `lay`. The quality of a byte is the lowest of its cells.
        """
        bits = self.layout.mode.code.bits
        size = self.groups * self.group_bytes
        placed, sure = np.empty(size, np.uint8), np.empty(size, np.float32)
        used = self.group_bytes * 8 // bits
        for n in range(self.groups):
            part = slice(n * self.group_bytes, (n + 1) * self.group_bytes)
            stream = self.keystream(block * self.groups + n)
            placed[part] = _bytes(values[n, :used], bits) ^ stream[: self.group_bytes]
            sure[part] = quality[n, :used].reshape(-1, 8 // bits).min(axis=1)
        return placed[self.places], sure[self.places]

    def cells_of(self, wrong: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Number of marked bytes, (words, 255) bool, on each data cell, (cells,)."""
        placed = np.zeros(self.groups * self.group_bytes, np.int64)
        placed[self.places] = wrong
        each = 8 // self.layout.mode.code.bits
        out = np.zeros(self.layout.cells, np.int64)
        counts = np.repeat(placed.reshape(self.groups, -1).sum(axis=0), each)
        out[: len(counts)] = counts
        return out

    def keystream(self, group: int) -> _Bytes:
        """Bytes of all cells of a group, from Philox 4x64."""
        if self.period is not None:
            group %= self.period
        stream = np.random.Philox(key=_KEY, counter=[0, group, 0, 0])
        count = self.group_bytes + 1  # one more byte for cells beyond the last whole byte
        raw = np.asarray(stream.random_raw(-(-count // 8)), "<u8")
        return raw.view(np.uint8)[:count].copy()


def _values(data: _Bytes, bits: int) -> _Bytes:
    """Bytes as values of `bits` bits, lowest first."""
    if bits == 8:
        return data
    shifts = np.arange(0, 8, bits, dtype=np.uint8)
    return ((data[:, None] >> shifts) & np.uint8((1 << bits) - 1)).reshape(-1)


def _bytes(values: _Bytes, bits: int) -> _Bytes:
    """Bytes of `_values`; higher bits of the values are ignored."""
    if bits == 8:
        return values
    shifts = np.arange(0, 8, bits, dtype=np.uint8)
    parts = (values.reshape(-1, 8 // bits) & np.uint8((1 << bits) - 1)) << shifts
    return np.bitwise_or.reduce(parts, axis=1).astype(np.uint8)
