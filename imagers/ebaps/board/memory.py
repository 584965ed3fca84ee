"""The board's memory: DDR behind an AXI4 port, with latency and random stalls, and the same as
whole bursts.

Reads and writes share one data bus of one beat per clock; bursts alternate. Latency and stalls
stand for row activation, bus turnaround and refresh. Both are assumed, since document 002 prints
neither. Stalls are random with a seed, so a run can be repeated.

`BurstMemory` carries the frames of the imager as AXI4 bursts. Each burst is one copy to the
addresses that the bus would have used: a frame of 1280 x 1024 is 2560 bursts. `crossing` runs
FIFOs, bus and DDR clock by clock; tests compare bursts and bytes of both.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.axi import BEAT_BYTES, BURST_BEATS, PAGE, Beat, Burst, Signals, bursts_of
from imagers.ebaps.board.fifo import Coin
from imagers.ebaps.board.timing import REGIONS, region_bytes

MEMORY_HZ = 200_000_000
"""Clock of the memory's AXI4 port, Hz: assumed."""
LATENCY_CLOCKS = 20
"""Time from a burst's turn to its first beat, 100 ns: assumed."""
Image = npt.NDArray[np.uint16]
Bytes = npt.NDArray[np.uint8]


class Ddr:
    """Bytes from address 0 to the end of the fifth region. bias: ADDR_BIAS."""

    def __init__(self, bias: int = 0) -> None:
        if bias < 0:
            raise ValueError("the bias must be 0 or more")
        self.bytes: npt.NDArray[np.uint8] = np.zeros(bias + REGIONS * region_bytes(), np.uint8)

    def write(self, address: int, data: int, strobe: int) -> None:
        """One beat; IndexError beyond the end."""
        if address + strobe.bit_length() > self.bytes.size:
            raise IndexError(f"address {address:#x} is beyond the memory")
        for n, value in enumerate(data.to_bytes(BEAT_BYTES, "little")):
            if strobe >> n & 1:
                self.bytes[address + n] = value

    def read(self, address: int) -> int:
        """One beat; zeros beyond the end."""
        return int.from_bytes(self.bytes[address : address + BEAT_BYTES].tobytes(), "little")


class DdrPort:
    """The memory's side of the bus. `awready`, `wready`, `b`, `arready` and `r` are its outputs.

    stall: share of clocks in which READY is low, and in which read data pauses, without another
    cause. depth: outstanding addresses that it accepts in each direction.
    """

    def __init__(
        self, ddr: Ddr, *, stall: float = 0.0, latency: int = LATENCY_CLOCKS, seed: int = 0,
        depth: int = 2,
    ) -> None:  # fmt: skip
        if not 0 <= stall < 1:
            raise ValueError("the share of stalled clocks must be 0 or more and below 1")
        self.ddr, self.stall, self.latency, self.depth = ddr, stall, latency, depth
        self.awready = self.wready = self.b = self.arready = False
        self.r: Beat | None = None
        self._coin = Coin(seed, 2)
        self._writes: deque[Burst] = deque()
        self._reads: deque[Burst] = deque()
        self._writing = False  # direction of the burst under way, or of the last one
        self._address = self._left = self._wait = self._answers = 0

    def _stalls(self) -> bool:
        return self.stall > 0 and self._coin.below(self.stall)

    def edge(self, seen: Signals) -> None:
        """An edge of the memory's clock."""
        if seen.aw is not None and seen.awready:
            self._writes.append(seen.aw)
        if seen.ar is not None and seen.arready:
            self._reads.append(seen.ar)
        if seen.w is not None and seen.wready:
            self.ddr.write(self._address, seen.w.data, seen.w.strobe)
            self._address += BEAT_BYTES
            self._left -= 1
            self._answers += self._left == 0
        if seen.r is not None and seen.rready:
            self.r = None
            self._address += BEAT_BYTES
            self._left -= 1
        if seen.b and seen.bready:
            self.b = False
        if self._answers and not self.b:
            self.b = True
            self._answers -= 1
        if self._left == 0:
            self._turn()
        elif self._wait:
            self._wait -= 1
        running = self._left > 0 and self._wait == 0
        self.wready = running and self._writing and not self._stalls()
        if running and not self._writing and self.r is None and not self._stalls():
            every = (1 << BEAT_BYTES) - 1
            self.r = Beat(self.ddr.read(self._address), every, self._left == 1)
        self.awready = len(self._writes) < self.depth and not self._stalls()
        self.arready = len(self._reads) < self.depth and not self._stalls()

    def _turn(self) -> None:
        """Selects the next burst: of the other direction if one waits there."""
        if self._writes and (not self._writing or not self._reads):
            self._writing, queue = True, self._writes
        elif self._reads:
            self._writing, queue = False, self._reads
        else:
            return
        burst = queue.popleft()
        self._address, self._left, self._wait = burst.address, burst.beats, self.latency


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
        beats: number of beats of a burst, a power of two.
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
