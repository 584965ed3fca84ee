"""Blocks with a rate each: a header in the block tells its code, and the panel's mode stays.

The light of a symbol tells less of its bit when the phase of the clocks is bad, and a receiver that
cannot steer its clock sees all phases pass. So each block of words has its own low-density
parity-check code. Frames of all rates are equal, as the fountain needs it: a block of a low rate
holds fewer of them. Their words have equally many bits of data, and those sent fill the block.

The header is the number of the rate as a word of the first-order Reed-Muller code (256, 9), one of
16 rows of a Hadamard matrix, any two of which differ in 128 bits. It replaces bits of words at 256
places spread over the block, which the decoder takes for erased. The receiver takes the row that
agrees most with the soft values. With a share p of wrong bits each other row is preferred with at
most the probability (4 p (1 - p))^64 (Bhattacharyya): 1e-12 at p = .2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt

from link.coding.blocks import FRAME_SPENT
from link.coding.ldpc import Ldpc
from link.coding.soft_blocks import SoftBlocks
from link.mode import EVERY_RATE

HEADER: Final = 256
"""Bits of a header."""
_ROWS: Final = 16
_LEAST: Final = 1 << 18
"""Bits of a block at least: a header is 1 in 1024, and whole frames fill the block well."""
_MOST_DATA: Final = 8448
"""Bits of data in a word at most, those of a full graph."""
_SHORTER: Final = 32
"""Steps of 8 bits by which words are shortened at most, to fill the block."""
_Bytes = npt.NDArray[np.uint8]
_Soft = npt.NDArray[np.int8]


def _rows() -> npt.NDArray[np.uint8]:
    """Headers, (16, 256) uint8 bits. Row r has the parity of r + 1 and the place: no header is
    constant, which a dark or a bright stretch would resemble."""
    place = np.arange(HEADER)
    number = np.arange(1, _ROWS + 1)
    return np.asarray(np.bitwise_count(number[:, None] & place) & 1, np.uint8)


def _frames(bits: int, rate: float, words: int, data_bits: int) -> int:
    """Frames of so many words that a block of a rate has room for."""
    return int(bits // (words * -(-data_bits // (8 * rate)) * 8))


@lru_cache
def _fullest(bits: int, most_words: int) -> tuple[int, int]:
    """Words of a frame and the bits of data in a word that leave most of the blocks of all rates to
    the file."""

    def filled(shape: tuple[int, int]) -> int:
        words, data_bits = shape
        size = (words * data_bits // 8 - FRAME_SPENT) // 8
        return sum(size * _frames(bits, rate, words, data_bits) for rate in EVERY_RATE)

    shorter = range(_MOST_DATA, _MOST_DATA - 8 * _SHORTER, -8)
    shapes = ((words, each) for words in range(1, most_words + 1) for each in shorter)
    return max(shapes, key=filled)


@dataclass(frozen=True)
class AdaptiveBlocks(SoftBlocks):
    """Blocks of one rate, of a mode with a rate for each block; see `Blocks`.

    Attributes:
        number: number of the rate in EVERY_RATE.
    """

    number: int = len(EVERY_RATE) - 1
    least_bits: ClassVar[int] = _LEAST

    rows: ClassVar[npt.NDArray[np.uint8]] = _rows()

    @property
    def rate(self) -> float:
        """Data bits per bit sent, at most."""
        return EVERY_RATE[self.number]

    def at(self, number: int) -> AdaptiveBlocks:
        """Blocks of another rate, which share groups and frames with these."""
        if number == self.number:
            return self
        if number not in self._others:
            self._others[number] = replace(self, number=number)
        return self._others[number]

    @cached_property
    def _others(self) -> dict[int, AdaptiveBlocks]:
        return {}

    @property
    def _bits(self) -> int:
        return self.groups * self._group_bits

    @cached_property
    def _shape(self) -> tuple[int, int]:
        """Words of a frame, and bits of data in a word."""
        return _fullest(self._bits, self.most_words)

    @property
    def data_bytes(self) -> int:
        return self._shape[1] // 8

    @property
    def frame_words(self) -> int:
        return self._shape[0]

    @cached_property
    def frames(self) -> int:
        return _frames(self._bits, self.rate, *self._shape)

    @property
    def words(self) -> int:
        return self.frames * self.frame_words

    @cached_property
    def code(self) -> Ldpc:
        """The code of the words."""
        return Ldpc(self._shape[1], self._bits // self.words // 8 * 8)

    @cached_property
    def places(self) -> npt.NDArray[np.intp]:
        """Places of the header's bits in the block: one in each of 256 stretches of it, and not in
        the same column of cells."""
        each = self._bits // HEADER
        bit = np.arange(HEADER)
        return bit * each + (bit * self._golden(each)) % each

    def lay(self, words: _Bytes, block: int) -> _Bytes:
        row = self._row(words)
        row.reshape(-1)[self.places] = self.rows[self.number]
        return self._values(row, block)

    def read_header(self, row: _Soft) -> int | None:
        """Reads the number of the rate in a block's soft values without the keystream, (groups,
        symbols, cells), and erases the header from them. None if no rate has that number, or
        nothing was received."""
        soft = row.reshape(-1)[self.places].astype(np.int64)
        row.reshape(-1)[self.places] = 0
        likely = (2 * self.rows.astype(np.int64) - 1) @ soft
        number = int(np.argmax(likely))
        return number if likely[number] > 0 and number < len(EVERY_RATE) else None
