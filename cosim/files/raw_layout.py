"""Layout of SpikeTwo-class raw words: position of each block on the chip, and its marker.

A frame is 2000 blocks of 64 bytes, each half a row: bits 0 to 499 are pixels from left to right,
least significant bit first, bits 500 to 511 a marker. The last 16 bits of a block, little-endian,
hold line = (w >> 4) & 0x3ff, 1 to 500, and channel = w >> 14, 0 to 3. A frame starts with the block
(channel 0, line 500) that follows (channel 3, line 500).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

RAW_SIZE = (1000, 1000)
"""Width and height of the pixels."""
BLOCK_BYTES = 64
BLOCKS = 2000
FRAME_BYTES = BLOCKS * BLOCK_BYTES
HALF = RAW_SIZE[0] // 2
"""Pixels in a block."""
MARKER_MASK = 0xFFF0
"""Bits of a block's last 16 that are its marker; the four below are pixels 496 to 499."""


class Table(NamedTuple):
    """Properties of the blocks of a frame, in the order of the file; each (2000,) int.

    Attributes:
        channel, line: numbers in the marker of the block.
        row: row of the chip.
        half: 0 for the left half of the row, 1 for the right.
    """

    channel: npt.NDArray[np.intp]
    line: npt.NDArray[np.intp]
    row: npt.NDArray[np.intp]
    half: npt.NDArray[np.intp]


def _chip_map() -> Table:
    """Position of each block on the chip.

    The map is not published; this is the simplest one that agrees with public readers. They read a
    frame from (channel 0, line 500) on as rows of two blocks, left and right, from the top row
    down. The block before is (channel 3, line 500). As a frame begins and ends with lines 500,
    lines count outwards from the middle of the chip in four quadrants: channels 0 and 1 are upper
    left and right, 2 and 3 lower left and right.
    """
    row, half = np.divmod(np.arange(BLOCKS), 2)
    lower = row >= RAW_SIZE[1] // 2
    line = np.where(lower, row - RAW_SIZE[1] // 2 + 1, RAW_SIZE[1] // 2 - row)
    return Table(2 * lower + half, line, row, half)


TABLE = _chip_map()


def markers(table: Table = TABLE) -> npt.NDArray[np.uint16]:
    """The marker of each block of a frame, within its last 16 bits, (2000,) uint16."""
    return (table.channel << 14 | table.line << 4).astype(np.uint16)
