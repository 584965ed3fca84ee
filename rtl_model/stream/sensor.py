"""A sensor's side of its data lanes: rows as lane words, and faults of a lane in bits.

Each lane carries eight columns of every tile, one word (eight bits, the earliest in bit 0) a clock:
the training word in pauses, and for a row the marker, the row's head, the bits and a CRC-8.
`viform_lines.v` describes the head.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from fastcrc import crc8

from rtl_model.geometry import Geometry

TRAINING = 0xE9
"""Word of a pause. Its rotations differ from each other in four bits or more."""
MARKER = 0x02
"""First word of a row. It differs from all rotations of the training word in four bits or more."""


def check_word(words: Iterable[int]) -> int:
    """CRC-8 of words: x^8 + x^2 + x + 1 from FF, most significant bit first, not inverted."""
    return int(crc8.smbus(bytes(words), 0xFF))


def lane_words(
    planes: Mapping[int, npt.NDArray[np.bool_]], geometry: Geometry, *, training: int, pause: int
) -> npt.NDArray[np.uint8]:
    """The words of all lanes, (clocks, lanes) uint8.

    Args:
        planes: (rows, columns) bool by number.
        geometry: geometry of the sensor; `lanes` is the width of a tile, eight columns a data lane.
        training: clocks of training before the first row.
        pause: clocks of training after each row, at least four.
    """
    wires = geometry.lanes // 8
    parts = [np.full((training, wires), TRAINING, np.uint8)]
    for number, plane in planes.items():
        wide = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), bool)
        wide[:, : geometry.columns] = plane
        words = np.packbits(wide, axis=1, bitorder="little").reshape(geometry.rows, -1, wires)
        for row in range(geometry.rows):
            head = [row & 255, (number & 15) << 4 | row >> 8, number >> 4 & 255]
            lanes = [head + words[row, :, wire].tolist() for wire in range(wires)]
            full = [[MARKER, *lane, check_word(lane)] for lane in lanes]
            parts += [np.array(full, np.uint8).T, np.full((pause, wires), TRAINING, np.uint8)]
    return np.concatenate(parts)


def disturbed(
    lane: npt.NDArray[np.uint8], *, slips: Sequence[tuple[int, int]] = (), wrong: Sequence[int] = ()
) -> npt.NDArray[np.uint8]:
    """A lane with bit errors, then bit slips; its length stays.

    Args:
        lane: words, (clocks,) uint8.
        slips: (place in bits, count): so many zeros are put in there, or, below 0, bits taken out.
        wrong: places of inverted bits.
    """
    bits = np.unpackbits(lane, bitorder="little")
    bits[list(wrong)] ^= 1
    for place, count in sorted(slips, reverse=True):
        if count > 0:
            bits = np.insert(bits, place, np.zeros(count, np.uint8))
        else:
            bits = np.delete(bits, slice(place, place - count))
    missing = max(0, 8 * lane.size - bits.size)
    return np.packbits(np.pad(bits, (0, missing))[: 8 * lane.size], bitorder="little")
