"""When the rows of an EBAPS frame are really reset: once, or a second time with a neighbour's.

One shift register says which row is reset (`drive`): a frame's reset moves it on by a row every
1280 clocks, with a pulse of RST and T in each. A frame's reset lasts 32.768 ms and begins anew
every 33.3 ms, less by how much the exposure has grown. Where it grows by more than the blanking
(0.565 ms: every step up of the loop, 0.64 ms), the next reset begins before this one has ended. The
register then holds two rows, and each pulse resets both. A row gathers from the last pulse that
falls while it is in the register, so the last rows of the former frame and the first of the latter
begin late, by less than a row's time (32 us).

That the reset uses a shift register, as opposed to a counter (which would lose its place), is
assumed, as is the place of the pulse in a row (`drive.RESETTING`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtl_model.imagers.ebaps.board.timing import Timing
from rtl_model.imagers.ebaps.device.drive import RESETTING

__all__ = ["late_resets", "row_times"]

Clocks = npt.NDArray[np.int64]


def late_resets(timing: Timing, frame: int, exposures: tuple[int | None, int, int | None]
                ) -> Clocks:  # fmt: skip
    """(rows,) clocks by which each row's last reset comes after its own frame's. exposures: of the
    frame before, of `frame` and of the one after, ns; None where there is none.

    Only neighbours can overlap: two periods are longer than two readouts.
    """
    columns = timing.columns
    rows = np.arange(timing.rows, dtype=np.int64)
    before, own, after = exposures
    late = np.zeros(timing.rows, np.int64)
    start = timing.rise(frame, own)
    window = columns - RESETTING["T"][1]  # a pulse that ends later ends in the row that follows
    for other, exposure in ((frame - 1, before), (frame + 1, after)):
        if exposure is None:
            continue
        # The other reset's pulse of its row q comes columns x q after its beginning: the first
        # after each row's own, if it is there and the row still in the register.
        apart = timing.rise(other, exposure) - start
        shift = apart % columns
        place = rows + (shift - apart) // columns
        hit = (place >= 0) & (place < timing.rows) & (0 < shift <= window)
        late = np.where(hit, np.maximum(late, shift), late)
    return late


def row_times(
    timing: Timing, frame: int, exposures: tuple[int | None, int, int | None], rows: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(rows,) ps each: begin and end of the exposure of a frame's first rows, as `Timing.row_times`
    with late resets. A row that would be reset after its reading gathers nothing."""
    begin, end = timing.row_times(frame, exposures[1], rows)
    late = late_resets(timing, frame, exposures)[:rows]
    start = timing.rise(frame, exposures[1])
    for row in np.flatnonzero(late):
        begin[row] = timing.ps(start + int(row) * timing.columns + int(late[row]))
    return np.minimum(begin, end), end
