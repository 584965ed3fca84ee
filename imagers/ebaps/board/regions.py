"""Frames in the board's memory: five regions of 1280 x 1024 x 2 bytes.

Document 002, section 3.2: regions 0 to 3 hold four dark frames, region 4 the live one, and KEY says
which is written. `burst_memory` models the memory's bursts.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

__all__ = ["LIVE", "REGIONS", "FrameMemory", "region_bytes"]

REGIONS = 5
"""Regions in memory: document 002, section 3.2."""
LIVE = 4
"""Region of the live frame; those before hold darks."""

Image = npt.NDArray[np.uint16]


def region_bytes(columns: int = 1280, rows: int = 1024, bits: int = 16) -> int:
    """Size of one frame in memory: 1280 x 1024 x 2 bytes."""
    return columns * rows * bits // 8


class FrameMemory(Protocol):
    """Holds frames by region."""

    def store(self, region: int, frame: Image) -> None:
        """Writes a frame, (H, W) uint16, to region 0 to 4."""

    def read(self, region: int) -> Image:
        """The frame that was last stored there; KeyError where none was."""
        ...
