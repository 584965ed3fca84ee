"""Times at which the blocks of the row scan leave the chip, in integer picoseconds.

The plane that is latched in cycle k is read during cycle k + 1, block by block, at 40.96 Gbit/s. At
this rate, 1000 rows of 1024 bits take exactly one cycle at 40 kHz. It is assumed that the scan
starts at the edge of the cycle and does not pause; no publication states this.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError
from cosim.clock import PS
from cosim.config.amounts import at_most
from cosim.files.raw_layout import BLOCK_BYTES, FRAME_BYTES
from rtl_model.readout.window import Window

BIT_RATE: Final = FRAME_BYTES * 8 * 40_000
"""Rate of the chip's output, bit/s: 40.96 Gbit/s."""
BLOCK_PS: Final = BLOCK_BYTES * 8 * PS // BIT_RATE
"""Duration of a block of 512 bits, ps: exactly 12 500."""


class ScanTiming:
    """Timing of the scan of a window.

    Args:
        clock: clock of the latch cycles.
        window: window that is read; the whole chip if None.

    Attributes:
        clock, window: clock and window as above.
        blocks: number of blocks in a cycle.

    Raises:
        InputError: if the scan takes longer than a cycle.
    """

    def __init__(self, clock: Clock, window: Window | None = None) -> None:
        self.clock = clock
        self.window = Window() if window is None else window.checked()
        self.blocks = len(self.window.read)
        least = PS * clock.den // clock.num  # shortest cycle, because edges are rounded down
        if self.scan_ps > least:
            raise InputError(
                "the clock of a readout",
                f"at most {at_most(PS / self.scan_ps)} Hz, at which {self.blocks // 2} rows are "
                "read in a cycle",
                f"{clock.hz:g} Hz", "lower it or read fewer rows",
            )  # fmt: skip

    @property
    def scan_ps(self) -> int:
        """Duration of a scan and so of the shortest cycle, ps: 25 000 for each row."""
        return self.blocks * BLOCK_PS

    def starts(self, cycle: int) -> npt.NDArray[np.int64]:
        """Start of each block of a cycle's plane, (blocks,) int64 ps. A block takes `BLOCK_PS`."""
        return self.clock.edge(cycle + 1) + BLOCK_PS * np.arange(self.blocks, dtype=np.int64)
