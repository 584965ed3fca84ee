"""Frame memory of the imager: frames cross the board's memory as AXI4 bursts.

There are two modes with the same result. `cycles=True` runs FIFOs, bus and DDR clock by clock
(`crossing`), for small frames. Otherwise each burst is one copy to the addresses that the bus would
have used: a frame of 1280 x 1024 is 2560 bursts. Tests compare bursts and bytes of both modes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from rtl_model.imagers.ebaps.board.axi import BEAT_BYTES, BURST_BEATS, PAGE, bursts_of
from rtl_model.imagers.ebaps.board.crossing import Clocks, Path, Transfer, transfer
from rtl_model.imagers.ebaps.board.ddr import Ddr
from rtl_model.imagers.ebaps.board.regions import REGIONS, region_bytes

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
        bursts: number since power-on.
        last: with `cycles`, the last transfer.

    Args:
        bias: ADDR_BIAS, a multiple of 4 KiB.
        beats: of a burst, a power of two.
        cycles: whether transfers run clock by clock.
        stall, clocks, seed: of such transfers, see `Path`; the seed grows by one for each.

    With `cycles`, InputError if the memory is too slow for a frame.
    """

    def __init__(
        self, *, bias: int = 0, beats: int = BURST_BEATS, cycles: bool = False, stall: float = 0.0,
        clocks: Clocks | None = None, seed: int = 0,
    ) -> None:  # fmt: skip
        if bias % PAGE:
            raise ValueError(f"the bias must be a multiple of {PAGE}, so that no burst crosses")
        if PAGE % (beats * BEAT_BYTES):
            raise ValueError(f"a burst must divide {PAGE} bytes, not have {beats} beats")
        self.ddr = Ddr(bias)
        self.bias, self.beats, self.cycles = bias, beats, cycles
        self.bursts = 0
        self.last: Transfer | None = None
        self._path = Path(bias, clocks or Clocks(), stall, seed=seed, beats=beats)
        self._shapes: dict[int, tuple[int, int]] = {}

    def store(self, region: int, frame: Image) -> None:
        """See `FrameMemory`."""
        if not 0 <= region < REGIONS:
            raise ValueError(f"a region must be 0 to {REGIONS - 1}, not {region}")
        if frame.ndim != 2 or frame.dtype != np.uint16 or not frame.size:
            raise ValueError(f"a frame must be (H, W) uint16, not {frame.dtype} {frame.shape}")
        if frame.nbytes > region_bytes():
            raise ValueError(f"a frame must fit {region_bytes()} bytes, not need {frame.nbytes}")
        if self.cycles:
            self._run(write=(region, frame))
        else:
            data = np.ascontiguousarray(frame, "<u2").view(np.uint8).ravel()
            for places, there in self._moves(region, data):
                self.ddr.bytes[places] = there
        self._shapes[region] = (frame.shape[0], frame.shape[1])

    def read(self, region: int) -> Image:
        """See `FrameMemory`."""
        return self.read_together([region])[0]

    def read_together(self, regions: list[int]) -> list[Image]:
        """Frames of one shape from several regions, read in parallel under one rd_en."""
        shapes = {self._shapes[region] for region in regions}
        if len(shapes) != 1:
            raise ValueError("frames that are read together must have one shape")
        shape = shapes.pop()
        if self.cycles:
            done = self._run(read=(regions, shape))
            return [done.frames[region] for region in regions]
        return [self._burst_read(region, shape) for region in regions]

    def _burst_read(self, region: int, shape: tuple[int, int]) -> Image:
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

    def _run(
        self, write: tuple[int, Image] | None = None,
        read: tuple[list[int], tuple[int, int]] | None = None,
    ) -> Transfer:  # fmt: skip
        done = transfer(self.ddr, self._path, write=write, read=read)
        self._path = replace(self._path, seed=self._path.seed + 1)
        self.last = done
        self.bursts += len(done.writes) + len(done.reads)
        if not done.done or done.overflows:
            raise InputError(
                "the EBAPS board's memory", "fast enough for its pixels",
                f"one whose write FIFO overflowed {done.overflows} times",
                "lower its share of stalled clocks or raise its clock",
            )  # fmt: skip
        return done
