"""Statistics of a frame: the saturated pixels of the window, and the largest unsaturated value.

For each pixel of the window, a comparator tests whether its voltage exceeds full scale, and a
counter adds these pixels up. A scan finds the largest unsaturated value (document 001, sections 3.1
and 3.2). The document scans the whole frame. The unsaturated rims of lamps outside the window would
then determine the exposure, which the window is meant to prevent. So the scan covers the window
only, unless `whole_scan` is set. With the window at reset, all pixels, both are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Statistics", "Window", "gather"]


class Window(NamedTuple):
    """Pixels that count.

    Attributes:
        top, bottom: first and last row, inclusive.
        left, right: first and last column, inclusive.
    """

    top: int
    bottom: int
    left: int
    right: int

    @property
    def size(self) -> int:
        """Number of pixels; 0 if a last row or column comes before the first."""
        return max(0, self.bottom - self.top + 1) * max(0, self.right - self.left + 1)


class Statistics(NamedTuple):
    """Statistics of a frame.

    Attributes:
        saturated: number of pixels of the window over full scale.
        largest: largest unsaturated value, DN; None if every pixel is saturated.
    """

    saturated: int
    largest: int | None


def gather(
    values: npt.NDArray[np.uint16],
    saturated: npt.NDArray[np.bool_],
    window: Window,
    *,
    whole_scan: bool = False,
) -> Statistics:
    """Returns the statistics of a frame.

    Args:
        values: (H, W) DN, uint16.
        saturated: (H, W) output of the comparator, bool.
        window: pixels that count.
        whole_scan: whether the largest value is sought among all pixels, not only in the window.
    """
    inside = (slice(window.top, window.bottom + 1), slice(window.left, window.right + 1))
    count = int(np.count_nonzero(saturated[inside]))
    where = (slice(None), slice(None)) if whole_scan else inside
    scanned, over = values[where], saturated[where]
    if over.all():
        return Statistics(count, None)
    return Statistics(count, int(np.where(over, 0, scanned).max()))
