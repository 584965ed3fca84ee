"""Reset times of the rows of an EBAPS frame, with overlapping resets of neighbouring frames.

A shift register selects the row to be reset (`drive`). It advances by one row every 1280 clocks,
with a pulse of RST and T in each row. The reset of a frame takes 32.768 ms, and resets begin every
33.3 ms minus the increase of the exposure. If the exposure increases by more than the blanking
(0.565 ms; a step of the loop is 0.64 ms), the next reset begins before this one has ended. The
register then holds two rows, and each pulse resets both. The exposure of a row begins with the last
pulse while the row is in the register, so the last rows of the earlier frame and the first rows of
the later one begin late, by less than a row time (32 us).

Assumed: a shift register rather than a counter (a single counter could not hold two rows), and the
position of the pulse in a row (`drive.RESETTING`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.timing import Timing
from imagers.ebaps.device.drive import RESETTING

__all__ = ["late_resets", "row_times"]

Clocks = npt.NDArray[np.int64]


def late_resets(timing: Timing, frame: int, exposures: tuple[int | None, int, int | None]
                ) -> Clocks:  # fmt: skip
    """(rows,) clocks between the reset of each row by its own frame and its last reset. exposures:
    of the previous frame, of `frame` and of the next frame, ns; None if there is no such frame.

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
    with late resets. A row whose last reset follows its read-out has no exposure."""
    begin, end = timing.row_times(frame, exposures[1], rows)
    late = late_resets(timing, frame, exposures)[:rows]
    start = timing.rise(frame, exposures[1])
    for row in np.flatnonzero(late):
        begin[row] = timing.ps(start + int(row) * timing.columns + int(late[row]))
    return np.minimum(begin, end), end
