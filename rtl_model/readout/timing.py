"""When every block of the row scan leaves the chip, in integer picoseconds.

What is latched in cycle k is read in the order of the blocks while cycle k + 1 runs, from its edge
on, at 40.96 Gbit/s: that rate reads 1000 rows of 1024 bits in exactly a 40 kHz cycle. That the scan
starts with the edge, without a pause, is assumed: no publication says.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError
from cosim.clock import PS
from cosim.files.raw_layout import BLOCK_BYTES, FRAME_BYTES
from rtl_model.readout.window import Window

__all__ = ["BIT_RATE", "BLOCK_PS", "ScanTiming"]

BIT_RATE: Final = FRAME_BYTES * 8 * 40_000
"""Bits a second of the chip's output: 40.96 Gbit/s."""
BLOCK_PS: Final = BLOCK_BYTES * 8 * PS // BIT_RATE
"""Picoseconds of a block of 512 bits: 12 500, exactly."""


class ScanTiming:
    """The scan of `window` at `clock`. InputError where it takes longer than a cycle."""

    def __init__(self, clock: Clock, window: Window | None = None) -> None:
        self.clock = clock
        self.window = Window() if window is None else window.checked()
        self.blocks = len(self.window.read)
        least = PS * clock.den // clock.num  # of any cycle: an edge is a floor
        if self.scan_ps > least:
            raise InputError(
                "the clock of a readout",
                f"at most {PS / self.scan_ps:.6g} Hz, at which {self.blocks // 2} rows are read in "
                "a cycle",
                f"{clock.hz:g} Hz", "lower it or read fewer rows",
            )  # fmt: skip

    @property
    def scan_ps(self) -> int:
        """Picoseconds of a scan, which is the shortest cycle: 25 000 a row."""
        return self.blocks * BLOCK_PS

    def starts(self, cycle: int) -> npt.NDArray[np.int64]:
        """When the first bit of each block of this cycle's plane leaves: (blocks,) int64 ps; the
        last has left BLOCK_PS later."""
        return self.clock.edge(cycle + 1) + BLOCK_PS * np.arange(self.blocks, dtype=np.int64)
