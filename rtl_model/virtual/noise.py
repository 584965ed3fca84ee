"""Noise of the serial line: random inversion of a byte's ten bits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from rtl_model.virtual.faults import Way

BITS = 10
"""Bits of a byte on the line: start, eight data bits, stop."""

_WORDS = 4  # of one draw
_DRAWS = -(-BITS // _WORDS)


def noise(share: float, seed: int, way: Way, first: int, count: int) -> npt.NDArray[np.uint16]:
    """Masks of inverted bits, (count,) uint16, start bit in bit 0.

    A bit depends only on seed, direction, number of the byte and number of the bit.

    Args:
        share: probability that a bit is inverted.
        seed: seed of the noise.
        way: direction.
        first: number of the first byte.
        count: number of bytes.
    """
    if share <= 0.0 or count == 0:
        return np.zeros(count, np.uint16)
    index = first + np.arange(count, dtype=np.uint64)
    low, high = index & np.uint64(0xFFFFFFFF), index >> np.uint64(32)
    limit = round(share * 2**32)
    masks = np.zeros(count, np.uint16)
    for draw in range(_DRAWS):
        words = philox4x32((low, high, draw, int(way == "tx")), (seed, Stream.SERIAL_NOISE))
        for place, word in enumerate(words[: BITS - _WORDS * draw]):
            hit = word.astype(np.uint64) < limit
            masks |= hit.astype(np.uint16) << np.uint16(_WORDS * draw + place)
    return masks
