"""Frame memory of the imager: frames cross the board's memory as AXI4 bursts.

Each burst is one copy to the addresses that the bus would have used: a frame of 1280 x 1024 is 2560
bursts. `crossing` runs FIFOs, bus and DDR clock by clock; tests compare bursts and bytes of both.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.axi import BEAT_BYTES, BURST_BEATS, PAGE, bursts_of
from imagers.ebaps.board.ddr import Ddr
from imagers.ebaps.board.regions import REGIONS, region_bytes

__all__ = ["BurstMemory"]

Image = npt.NDArray[np.uint16]
Bytes = npt.NDArray[np.uint8]


@lru_cache(maxsize=64)
def _joined(
    bias: int, region: int, size: int, beats: int
) -> tuple[int, tuple[tuple[int, int], ...]]:
    """Number of bursts for `size` bytes of a region, and (address, size) of each contiguous run of
    bursts. It is the same for every frame of one size."""
    runs: list[tuple[int, int]] = []
    bursts = 0
    for address, count in bursts_of(bias, region, size, beats):
        bursts += 1
        if runs and sum(runs[-1]) == address:
            runs[-1] = runs[-1][0], runs[-1][1] + count * BEAT_BYTES
        else:
            runs.append((address, count * BEAT_BYTES))
    left = size - sum(length for _, length in runs[:-1])  # the last burst may not be full
    runs[-1] = runs[-1][0], left
    return bursts, tuple(runs)


class BurstMemory:
    """See `FrameMemory`.

    Attributes:
        ddr: the bytes.
        bursts: number since power-on.

    Args:
        bias: ADDR_BIAS, a multiple of 4 KiB.
        beats: of a burst, a power of two.
    """

    def __init__(self, *, bias: int = 0, beats: int = BURST_BEATS) -> None:
        if bias % PAGE:
            raise ValueError(f"the bias must be a multiple of {PAGE}, so that no burst crosses")
        if PAGE % (beats * BEAT_BYTES):
            raise ValueError(f"a burst must divide {PAGE} bytes, not have {beats} beats")
        self.ddr = Ddr(bias)
        self.bias, self.beats = bias, beats
        self.bursts = 0
        self._shapes: dict[int, tuple[int, int]] = {}

    def claim(self, region: int, frame: Image) -> None:
        """Notes that a region holds a frame of this shape, which another writes. ValueError for one
        that does not fit."""
        if not 0 <= region < REGIONS:
            raise ValueError(f"a region must be 0 to {REGIONS - 1}, not {region}")
        if frame.ndim != 2 or frame.dtype != np.uint16 or not frame.size:
            raise ValueError(f"a frame must be (H, W) uint16, not {frame.dtype} {frame.shape}")
        if frame.nbytes > region_bytes():
            raise ValueError(f"a frame must fit {region_bytes()} bytes, not need {frame.nbytes}")
        self._shapes[region] = (frame.shape[0], frame.shape[1])

    def store(self, region: int, frame: Image) -> None:
        """See `FrameMemory`."""
        self.claim(region, frame)
        data = np.ascontiguousarray(frame, "<u2").view(np.uint8).ravel()
        for places, there in self._moves(region, data):
            self.ddr.bytes[places] = there

    def read(self, region: int) -> Image:
        """See `FrameMemory`."""
        shape = self._shapes[region]
        data = np.empty(2 * shape[0] * shape[1], np.uint8)
        for places, there in self._moves(region, data):
            there[:] = self.ddr.bytes[places]
        return data.view("<u2").astype(np.uint16, copy=False).reshape(shape)

    def _moves(self, region: int, data: Bytes) -> Iterator[tuple[slice, Bytes]]:
        """(address, part of `data`) of each burst; contiguous bursts are joined."""
        bursts, runs = _joined(self.bias, region, data.size, self.beats)
        self.bursts += bursts
        at = 0
        for start, size in runs:
            yield slice(start, start + size), data[at : at + size]
            at += size
