"""What a link behind the row scan must carry, in closed form, and what one that is slower loses.

Of R rows of 1024 bit a scan, each in tau = 25 ns, at b bit/s: a buffer that was empty at the first
row holds (n + 1) 1024 - n b tau bits when row n has begun, for b up to the rate of the chip. All
rows of a scan fit into B bytes if that is at most 8 B for n = R - 1, and the buffer is empty again
at the next scan if R 1024 bits leave in a cycle.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

from cosim.clock import PS
from rtl_model.readout.buffer import ROW_BYTES, ROW_PS, RowBuffer
from rtl_model.readout.timing import BIT_RATE, ScanTiming

_ROW_BITS: Final = ROW_BYTES * 8
_MOST: Final = 4000
"""Cycles of a run whose losses a plan computes, at most."""


def needed_rate(timing: ScanTiming, size: int) -> int:
    """Least rate at which a link loses no row, bit/s, rounded up to kbit/s.

    Args:
        timing: timing of the scan.
        size: size of the buffer, bytes.
    """
    rows, hz = timing.blocks // 2, timing.clock.num / timing.clock.den
    rate = rows * _ROW_BITS * hz
    if rows > 1:
        spare = (size * 8 - _ROW_BITS) / (rows - 1)
        rate = max(rate, (_ROW_BITS - spare) * PS / ROW_PS)
    return math.ceil(rate / 1000 * (1 - 1e-12)) * 1000


def needed_buffer(timing: ScanTiming, rate: int) -> int | None:
    """Least buffer with which a link of `rate` bit/s loses no row, bytes; None if the scan brings
    more than the link carries."""
    rows, clock = timing.blocks // 2, timing.clock
    if rows * _ROW_BITS * clock.num > rate * clock.den:
        return None
    left = min(rate, BIT_RATE) * ROW_PS * (rows - 1) // PS
    return max(ROW_BYTES, -(-(rows * _ROW_BITS - left) // 8))


@dataclass(frozen=True)
class Needs:
    """The readout of a run before it.

    Attributes:
        chip_bps: rate of the chip during the scan of a plane.
        mean_bps: the same over whole cycles, with the blank time behind each scan.
        needed_bps: least rate of the link at which nothing is lost with this buffer.
        rate_bps: rate of the link.
        buffer_bytes: the buffer.
        needed_buffer_bytes: least buffer with which this link loses nothing; None for none.
        lost_share: share of the rows that are lost.
        cycles: number of cycles from the start of the run, for which `lost_share` is computed.
        file_bytes: size of the whole file without loss, 0 for none.
    """

    chip_bps: int
    mean_bps: float
    needed_bps: int
    rate_bps: int
    buffer_bytes: int
    needed_buffer_bytes: int | None
    lost_share: float
    cycles: int
    file_bytes: int

    @classmethod
    def of(cls, buffer: RowBuffer, cycles: int, keep: bool) -> Needs:
        """The needs of a run of `cycles` cycles. buffer: new; it is used up."""
        timing, some = buffer.timing, min(cycles, _MOST)
        buffer.scan(0, some)
        rows = timing.blocks // 2
        return cls(
            BIT_RATE, rows * _ROW_BITS * timing.clock.hz, needed_rate(timing, buffer.size),
            buffer.rate, buffer.size, needed_buffer(timing, buffer.rate),
            buffer.lost / buffer.offered, some, cycles * rows * ROW_BYTES if keep else 0,
        )  # fmt: skip

    def document(self) -> dict[str, Any]:
        """The key `readout` of `viform plan --json`."""
        return asdict(self)
