"""What the saturation statistics and the pixel scan see of a frame.

A comparator tells of each pixel that enters the window whether its voltage is over full scale, and
a counter adds them up; the scan keeps the largest value that is not saturated (document 001,
sections 3.1 and 3.2). The print scans the whole frame for it. Lamps outside the window would then
hold the exposure by their unsaturated rims, which is what the window is there to prevent, so the
scan may be kept to the window; with the window that is set at reset, all pixels, both are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Statistics", "Window", "gather"]


class Window(NamedTuple):
    """Pixels that count: rows and columns, first and last, both inclusive."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def size(self) -> int:
        """Pixels in it; 0 where a last one comes before its first."""
        return max(0, self.bottom - self.top + 1) * max(0, self.right - self.left + 1)


class Statistics(NamedTuple):
    """saturated: pixels of the window over full scale. largest: value of the largest pixel that is
    not saturated, None where all are."""

    saturated: int
    largest: int | None


def gather(
    values: npt.NDArray[np.uint16],
    saturated: npt.NDArray[np.bool_],
    window: Window,
    *,
    whole_scan: bool = False,
) -> Statistics:
    """Statistics of a frame, values and saturation (H, W). whole_scan: the scan goes over all
    pixels, not over the window only."""
    inside = (slice(window.top, window.bottom + 1), slice(window.left, window.right + 1))
    count = int(np.count_nonzero(saturated[inside]))
    where = (slice(None), slice(None)) if whole_scan else inside
    seen, over = values[where], saturated[where]
    if over.all():
        return Statistics(count, None)
    return Statistics(count, int(np.where(over, 0, seen).max()))
