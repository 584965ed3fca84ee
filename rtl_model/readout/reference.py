"""The row scan in numpy: reference of the OpenCL kernel for results and for speed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.files.raw_layout import BLOCK_BYTES, HALF, RAW_SIZE
from cosim.spikes.viform import Words, unpack_planes
from rtl_model.readout.window import Window


def read_in_numpy(words: Words, cycles: int, window: Window | None = None) -> npt.NDArray[np.uint8]:
    """Raw bytes of the chip's output, (cycles, blocks, 64) uint8.

    Args:
        words: spike words, (n, 1000, 1000) uint32.
        cycles: number of latch cycles.
        window: window that is read; the whole chip if None.
    """
    window = Window() if window is None else window.checked()
    halves = unpack_planes(words, 0, cycles).reshape(cycles, 2 * RAW_SIZE[1], HALF)
    places = window.places
    bits = np.zeros((cycles, len(places), BLOCK_BYTES * 8), np.uint8)
    bits[..., :HALF] = halves[:, places] & window.open[places % 2]
    raw = np.packbits(bits, axis=2, bitorder="little")
    raw[..., -2:] |= window.markers.astype("<u2").view(np.uint8).reshape(-1, 2)
    return raw
