"""The buffer between the row scan and the link to the host, row by row, and in closed form.

The scan cannot wait: its rows come at fixed times. The link takes bits from the buffer at its own
rate, in their order. A row is accepted whole or not at all, by the room at its start, as the
capture of the board does it (`viform_capture.v`): a marker names channel and line of a block, so a
host can place each row without those that are missing, while a part of a row would leave blocks
without their pair, and to drop whole planes the buffer would have to hold a plane. The room of a
row is taken from its start on; its bits leave as soon as those before them have left.

Lost rows, fill and delays depend on the times alone, not on the light. All numbers are exact: times
are integer picoseconds, and the fill counts 1e-9 bit, of which a link of b kbit/s takes b in a
picosecond. The section [readout] therefore has whole kbit/s.

What a link must carry has a closed form. Of R rows of 1024 bit a scan, each in tau = 25 ns, at
b bit/s: a buffer that was empty at the first row holds (n + 1) 1024 - n b tau bits when row n has
begun, for b up to the rate of the chip. All rows of a scan fit into B bytes if that is at most 8 B
for n = R - 1, and the buffer is empty again at the next scan if R 1024 bits leave in a cycle.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import PS
from cosim.files.raw import BLOCK_BYTES
from cosim.stage import State
from rtl_model.readout.scan import BIT_RATE, BLOCK_PS, ScanTiming

Kept = npt.NDArray[np.bool_]
ROW_BYTES: Final = 2 * BLOCK_BYTES
ROW_PS: Final = 2 * BLOCK_PS
"""Duration of a row on the chip's output, ps."""
_BIT: Final = 10**9
"""Units of the fill in a bit."""
_FINE: Final = 10
"""Binary digits of a delay by which the histogram tells it from others, after the first one."""
_BINS: Final = 54 << _FINE
_ROW_BITS: Final = ROW_BYTES * 8
_MOST: Final = 4000
"""Cycles of a run whose losses a plan computes, at most."""


class RowBuffer:
    """Buffer and link behind the row scan.

    Args:
        timing: timing of the scan.
        rate: rate of the link, bit/s, whole kbit/s; as fast as the chip is `BIT_RATE`.
        size: size of the buffer, bytes, at least a row.

    Attributes:
        offered, lost: rows so far.

    Raises:
        ValueError: for a rate or a size that the arithmetic does not hold.
    """

    def __init__(self, timing: ScanTiming, rate: int, size: int) -> None:
        if rate < 1000 or rate % 1000 or not ROW_BYTES <= size <= 10**9:
            raise ValueError(f"whole kbit/s and 128 to 1e9 bytes, not {rate} bit/s and {size}")
        self.timing, self.rate, self.size = timing, rate, size
        self._rows = timing.blocks // 2
        self.offered = self.lost = 0
        self._state = np.array([0, 0, np.iinfo(np.int64).max, 0], np.int64)
        self._delays = np.zeros(_BINS, np.int64)

    def scan(self, first: int, cycles: int) -> tuple[Kept, npt.NDArray[np.int64]]:
        """Passes the planes of cycles `first` to `first + cycles` (excluded), which come in order.

        Returns:
            Whether each row is kept, (cycles, rows) bool in the order of the scan, and the largest
            fill during each scan, (cycles,) int64 bytes, rounded up.
        """
        clock = self.timing.clock
        starts = np.array([clock.edge(first + n + 1) for n in range(cycles)], np.int64)
        kept, peak = np.empty((cycles, self._rows), np.bool_), np.empty(cycles, np.int64)
        _scan(
            starts, ROW_PS, ROW_BYTES * 8 * _BIT, self.size * 8 * _BIT, self.rate // 1000,
            self._state, kept, peak, self._delays, _FINE,
        )  # fmt: skip
        self.offered += kept.size
        self.lost += kept.size - int(kept.sum())
        return kept, -(-peak // (8 * _BIT))

    @property
    def delivered(self) -> int:
        """Rows that reach the host; those in the buffer at the end of a run do."""
        return self.offered - self.lost

    @property
    def delays_us(self) -> tuple[float, float, float] | None:
        """Least, median and largest time from the latch to the last bit of a row at the host, of
        the rows that reach it, us; the median within 0.05 %. None without a row.

        The flight in a cable is not included: 5 ns a metre.
        """
        if not self.delivered:
            return None
        place = int(np.searchsorted(np.cumsum(self._delays), (self.delivered + 1) // 2))
        shift = max((place >> _FINE) - 1, 0)
        low = (place - (shift << _FINE)) << shift
        median = low + ((1 << shift) - 1) / 2
        return float(self._state[2]) / 1e6, median / 1e6, float(self._state[3]) / 1e6

    def state(self) -> State:
        counts = np.array([self.offered, self.lost], np.int64)
        return {"fill": self._state.copy(), "delays": self._delays.copy(), "counts": counts}

    def restore(self, state: State) -> None:
        """Continues from a `state`. Raises ValueError for one of another form."""
        values: list[npt.NDArray[Any]] = [state[name] for name in ("fill", "delays", "counts")]
        if [each.shape for each in values] != [(4,), (_BINS,), (2,)]:
            raise ValueError("the state of the buffer has another form")
        self._state, self._delays = values[0].copy(), values[1].copy()
        self.offered, self.lost = (int(n) for n in values[2])


@njit(cache=True, nogil=True)
def _scan(starts, row_ps, row, room, drain, state, kept, peak, histogram, fine):  # type: ignore[no-untyped-def]
    """Passes rows through the buffer; see `RowBuffer.scan`.

    starts: start of each scan, ps. row, room: a row and the buffer, 1e-9 bit. drain: of the link,
    1e-9 bit/ps. state: fill, its time, least and largest delay (ps); changed, like kept (scans,
    rows), peak (scans,) and histogram.
    """
    fill, at, least, most = state[0], state[1], state[2], state[3]
    for k in range(kept.shape[0]):
        high = np.int64(0)
        for n in range(kept.shape[1]):
            start = starts[k] + n * row_ps
            passed = start - at
            fill = np.int64(0) if passed > fill // drain else fill - passed * drain
            at = start
            kept[k, n] = fill + row <= room
            if not kept[k, n]:
                high = max(high, fill)
                continue
            fill += row
            high = max(high, fill)
            delay = n * row_ps + max(row_ps, -(-fill // drain))
            least, most = min(least, delay), max(most, delay)
            shift = 0
            while delay >> shift >= 2 << fine:
                shift += 1
            histogram[(shift << fine) + (delay >> shift)] += 1
        peak[k] = high
    state[0], state[1], state[2], state[3] = fill, at, least, most


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
