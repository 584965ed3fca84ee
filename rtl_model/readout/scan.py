"""The row scan of the whole chip on an OpenCL device."""

from __future__ import annotations

from importlib.resources import files
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.files.raw_layout import BLOCK_BYTES, RAW_SIZE
from cosim.spikes.viform import Words, words_for
from rtl_model.readout.window import Window

_LOCAL: Final = 8
"""Blocks of a work-group; a fixed size lets PoCL compile the kernel only once."""

Bytes = npt.NDArray[np.uint8]


class Readout:
    """The row scan of a window.

    Args:
        device: OpenCL device.
        window: window that is read; the whole chip if None. Raises InputError for one outside the
            chip.

    Attributes:
        window: window that is read.
        blocks: number of blocks in a cycle.
    """

    def __init__(self, device: Device, window: Window | None = None) -> None:
        self.window = Window() if window is None else window.checked()
        source = (files("rtl_model.readout") / "scan.cl").read_text(encoding="utf-8")
        options = ("-cl-std=CL1.2", f"-DLOCAL={_LOCAL}")
        self._device, self._kernel = device, device.kernel(source, "scan", options)
        places = self.window.places
        self.blocks = len(places)
        bits = np.zeros((2, BLOCK_BYTES * 8), bool)
        bits[:, : self.window.open.shape[1]] = self.window.open
        mask = np.packbits(bits, axis=1, bitorder="little")
        self._tables = [device.upload(table) for table in (places, self.window.markers, mask)]

    def read(self, words: Words, cycles: int, into: Bytes | None = None) -> Bytes:
        """Raw bytes in the order in which they leave the chip, (cycles, blocks, 64) uint8.

        Args:
            words: spike words of the cycles, (n, 1000, 1000) uint32.
            cycles: number of latch cycles.
            into: array for the result, which streaming callers reuse; a new one if None.

        Raises:
            ValueError: for another shape or dtype.
        """
        shape = (words_for(cycles), *RAW_SIZE[::-1])
        if cycles < 1 or words.shape != shape or words.dtype != np.uint32:
            raise ValueError(f"words must be {shape} uint32, not {words.shape} {words.dtype}")
        size = (cycles, self.blocks, BLOCK_BYTES)
        raw = np.empty(size, np.uint8) if into is None else into
        if raw.shape != size or raw.dtype != np.uint8 or not raw.flags.c_contiguous:
            raise ValueError(f"bytes must be {size} uint8, not {raw.shape} {raw.dtype}")
        device, contiguous = self._device, np.ascontiguousarray(words)
        source = device.share(contiguous)
        result = device.target(raw)
        across = -(-self.blocks // _LOCAL) * _LOCAL
        self._kernel(
            device.queue, (across, len(words)), (_LOCAL, 1), source, *self._tables, result,
            np.uint32(self.blocks), np.uint32(cycles),
        )  # fmt: skip
        device.settle(result, raw)
        return raw
