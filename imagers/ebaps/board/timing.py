"""Exposure and read-out times of the rows of an EBAPS, in clocks of 40 MHz, and the regions of the
memory that its frames go to.

VSYNC falls 30 times per second, on the last edge of the pixel clock before the nominal time. It is
high for the exposure time before each fall. From its rise the rows are reset, one every 1280
clocks; from its fall they are read at the same pace: a rolling shutter. Frame k is exposed in
period k and read in period k + 1. Its mean is known 32.768 ms into period k + 1: 0.57 ms before
frame k + 2 begins, but after frame k + 1 has begun (the shortest exposure is 1 ms). The mean of
frame k can therefore change frame k + 2 at the earliest.

The memory has five regions of 1280 x 1024 x 2 bytes (document 002, section 3.2). Regions 0 to 3
hold four dark frames, region 4 the live one, and KEY says which is written. Module `memory` models
the memory's bursts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import PS

CLOCK_HZ = 40_000_000
"""Pixel clock, Hz: document 002, section 3.1 (the chip may go up to 80 MHz)."""
FRAME_RATE = 30
"""Frames a second: document 002, abstract and section 1."""
REGIONS = 5
"""Regions in memory: document 002, section 3.2."""
LIVE = 4
"""Region of the live frame; those before hold darks."""
Image = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class Timing:
    """Frame size and clock of a read-out mode.

    Attributes:
        columns, rows: read in a frame.
        clock_hz: frequency of the pixel clock.
        rate: frames a second.
    """

    columns: int = 1280
    rows: int = 1024
    clock_hz: int = CLOCK_HZ
    rate: int = FRAME_RATE

    def __post_init__(self) -> None:
        if min(self.columns, self.rows, self.clock_hz, self.rate) <= 0:
            raise ValueError("columns, rows, clock and rate must be above 0")
        if self.columns * self.rows * self.rate > self.clock_hz:
            raise ValueError("a frame must be read within its period")

    @property
    def readout_clocks(self) -> int:
        """Clocks to read all rows, without blanking."""
        return self.columns * self.rows

    @property
    def longest_exposure(self) -> int:
        """T_max = m n / f, ns, rounded down: 32 768 000 as printed."""
        return self.readout_clocks * 10**9 // self.clock_hz

    @property
    def blanking(self) -> float:
        """Share of a period in which nothing is read: 1.7 % at 30 frames/s and 40 MHz."""
        return 1 - self.readout_clocks * self.rate / self.clock_hz

    def vsync(self, frame: int) -> int:
        """Clock at which VSYNC falls and period `frame` begins."""
        return frame * self.clock_hz // self.rate

    def exposure_clocks(self, nanoseconds: int) -> int:
        """Whole clocks of an exposure, rounded down, no longer than the period allows."""
        clocks = nanoseconds * self.clock_hz // 10**9
        return min(max(clocks, 0), self.clock_hz // self.rate)

    def rise(self, frame: int, exposure: int) -> int:
        """Clock at which VSYNC rises in a period: the first row's exposure begins. exposure: ns."""
        return self.vsync(frame + 1) - self.exposure_clocks(exposure)

    def ready(self, frame: int) -> int:
        """Clock at which a frame's last pixel has been read."""
        return self.vsync(frame + 1) + self.readout_clocks

    def ps(self, clock: int) -> int:
        """Instant of a clock's edge."""
        return clock * PS // self.clock_hz

    def row_times(
        self, frame: int, exposure: int, rows: int
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """(rows,) ps each: begin and end of the exposure of a frame's first rows."""
        steps = range(0, rows * self.columns, self.columns)
        begin, end = self.rise(frame, exposure), self.vsync(frame + 1)
        return (
            np.array([self.ps(begin + s) for s in steps], np.int64),
            np.array([self.ps(end + s) for s in steps], np.int64),
        )


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
