"""The board's DDR memory and its AXI4 port, with latency and random stalls.

Reads and writes share one data bus of one beat per clock; bursts alternate. Latency and stalls
stand for row activation, bus turnaround and refresh. Both are assumed, since document 002 prints
neither. Stalls are random with a seed, so a run can be repeated.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.axi import BEAT_BYTES, Beat, Burst, Signals
from imagers.ebaps.board.fifo import Coin
from imagers.ebaps.board.regions import REGIONS, region_bytes

__all__ = ["LATENCY_CLOCKS", "MEMORY_HZ", "Ddr", "DdrPort"]

MEMORY_HZ = 200_000_000
"""Clock of the memory's AXI4 port, Hz: assumed."""
LATENCY_CLOCKS = 20
"""From a burst's turn to its first beat, 100 ns: assumed."""


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
