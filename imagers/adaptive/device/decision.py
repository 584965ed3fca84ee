"""The exposure decision on a frame and the statistics that it reads: the number of saturated pixels
of the window, and the largest unsaturated value.

For each pixel of the window, a comparator tests whether its voltage exceeds full scale, and a
counter adds these pixels up. A scan finds the largest unsaturated value (document 001, sections 3.1
and 3.2). The document scans the whole frame. The unsaturated rims of lamps outside the window would
then determine the exposure, which the window is meant to prevent. So the scan covers the window
only, unless `whole_scan` is set. With the window at reset, all pixels, both are the same.

The decision (document 001, sections 2 and 3.3) keeps the exposure, lengthens it by the table, or
shortens it by a search. The exposure is a power of two times the shortest exposure T. The
document leaves these points open:

- Its table ends at x128, for a largest value of 1. A value of 0 lengthens by one more step, x256,
  as "1/2 LSB in one frame, 1/256 LSB in two" requires.
- Its multiplier register has 24 bits, but its search starts at 2^24 T, which needs a 25th bit. The
  model uses 25 bits (`MULTIPLIER_BITS`); with 24 bits the longest exposure would be 2^23 T.
- "The square root of t, rounded" halves the exponent and rounds it down, because multipliers are
  powers of two (the mask keeps the highest set bit).
- If every pixel is saturated but the number is allowed, the exposure is kept.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

HALF_SCALE: Final = 128
"""Half scale of the 8-bit converter, DN. A largest value from here on keeps the exposure."""
PRINTED_MULTIPLIER_BITS: Final = 24
"""Bits of the multiplier register in the document (section 3.3)."""
MULTIPLIER_BITS: Final = 25
"""Bits that the multiplier 2^24 needs, from which the document's search starts."""
LONGEST: Final = MULTIPLIER_BITS - 1
"""Exponent of the largest multiplier."""


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
    """The statistics of a frame.

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


class Search(IntEnum):
    """How an exposure t with too many saturated pixels is shortened; numbers of the document."""

    PART = 1
    """t / 256."""
    ROOT = 2
    """The square root of the multiplier."""
    HALF = 3
    """t / 2."""


class Decision(NamedTuple):
    """A decision.

    Attributes:
        multiplier: exposure chosen, in units of T.
        flag: whether too many pixels were saturated.
    """

    multiplier: int
    flag: bool


def highest(number: int) -> int:
    """The value of the highest set bit: 64 for 100, and 0 for 0."""
    return 1 << (number.bit_length() - 1) if number else 0


def lengthening(value: int) -> int:
    """Factor of the exposure for the largest unsaturated value, by its highest set bit: 1 for
    128..255, 2 for 64..127, ... 128 for 1 (table 1), and 256 for 0."""
    return 1 << (HALF_SCALE.bit_length() - value.bit_length())


def shortened(multiplier: int, search: Search) -> int:
    """The next multiplier of a search after one that saturates; at least 1."""
    if search is Search.PART:
        return max(1, highest(multiplier >> 8))
    if search is Search.ROOT:
        return highest(math.isqrt(multiplier))
    return max(1, highest(multiplier >> 1))


def decide(
    multiplier: int,
    saturated: int,
    largest: int | None,
    *,
    threshold: int,
    search: Search,
    longest: int = LONGEST,
) -> Decision:
    """The decision on a frame.

    Args:
        multiplier: exposure of the frame, in units of T.
        saturated: number of saturated pixels of the window.
        largest: largest unsaturated value, DN; None if every pixel is saturated.
        threshold: number of saturated pixels that is allowed.
        search: how to shorten.
        longest: exponent of the largest multiplier.
    """
    if saturated > threshold:
        return Decision(min(shortened(multiplier, search), 1 << longest), True)
    factor = 1 if largest is None else lengthening(largest)
    if factor == 1:
        return Decision(min(multiplier, 1 << longest), False)
    return Decision(min(highest(multiplier) * factor, 1 << longest), False)
