"""The buffer between the row scan and the link to the host, row by row.

The scan cannot wait: its rows come at fixed times. The link takes bits from the buffer at its own
rate, in their order. A row is accepted whole or not at all, by the room at its start, as the
capture of the board does it (`viform_capture.v`): a marker names channel and line of a block, so a
host can place each row without those that are missing, while a part of a row would leave blocks
without their pair, and to drop whole planes the buffer would have to hold a plane. The room of a
row is taken from its start on; its bits leave as soon as those before them have left.

Lost rows, fill and delays depend on the times alone, not on the light. All numbers are exact: times
are integer picoseconds, and the fill counts 1e-9 bit, of which a link of b kbit/s takes b in a
picosecond. The section [readout] therefore has whole kbit/s.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.files.raw_layout import BLOCK_BYTES
from cosim.stage import State
from rtl_model.readout.timing import BLOCK_PS, ScanTiming

ROW_BYTES: Final = 2 * BLOCK_BYTES
ROW_PS: Final = 2 * BLOCK_PS
"""Duration of a row on the chip's output, ps."""
_BIT: Final = 10**9
"""Units of the fill in a bit."""
_FINE: Final = 10
"""Binary digits of a delay by which the histogram tells it from others, after the first one."""
_BINS: Final = 54 << _FINE

Kept = npt.NDArray[np.bool_]


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
