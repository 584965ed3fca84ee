"""What the exposure selection does with a frame: keep, lengthen by the table, shorten by a search.

Document 001, sections 2 and 3.3. Exposure is a multiple of the shortest, T, and the multiple a
power of two. Readings of the print that had to be chosen:

- Its table ends at x128, for a largest value of 1. A value of 0 asks for one step more, x256:
  that is what its "1/2 LSB in one frame, 1/256 LSB in two" needs.
- Its multiplier register has 24 bits, its search starts at 2^24 T: that takes a 25th bit, which is
  used (`MULTIPLIER_BITS`). With 24 bits the longest is 2^23 T.
- "The square root of t, rounded" halves the exponent and rounds it down, since multiples are powers
  of two (the mask keeps the highest set bit).
- Where no pixel is unsaturated and the count is still allowed, there is nothing to go by: keep.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

__all__ = [
    "HALF_SCALE",
    "LONGEST",
    "MULTIPLIER_BITS",
    "PRINTED_MULTIPLIER_BITS",
    "Decision",
    "Search",
    "decide",
    "highest",
    "lengthening",
    "shortened",
]

HALF_SCALE: Final = 128
"""Of the 8-bit converter, DN: a largest value from here on keeps the exposure."""
PRINTED_MULTIPLIER_BITS: Final = 24
"""Of the multiplier register, as printed (section 3.3)."""
MULTIPLIER_BITS: Final = 25
"""As 2^24 T, from which the print's search starts, needs them."""
LONGEST: Final = MULTIPLIER_BITS - 1
"""Exponent of the largest multiplier."""


class Search(IntEnum):
    """How to shorten an exposure that saturates, by the print's numbers."""

    PART = 1
    """t / 256."""
    ROOT = 2
    """The square root of the multiplier."""
    HALF = 3
    """t / 2."""


class Decision(NamedTuple):
    """multiplier: of the exposure chosen. flag: too many pixels were saturated."""

    multiplier: int
    flag: bool


def highest(number: int) -> int:
    """The number's highest set bit, in place: 100 gives 64. 0 gives 0."""
    return 1 << (number.bit_length() - 1) if number else 0


def lengthening(value: int) -> int:
    """Factor that the largest unsaturated value asks for by its highest set bit: 128..255 1,
    64..127 2, ... 1 128 (table 1), and 0 256."""
    return 1 << (HALF_SCALE.bit_length() - value.bit_length())


def shortened(multiplier: int, search: Search) -> int:
    """The next multiplier to try when one saturates; 1 stays."""
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
    """The multiplier that follows from a frame which was exposed with `multiplier`.

    saturated: pixels of the window that were. largest: value of those that were not, None where
    there was no such. threshold: saturated pixels that are still allowed. longest: exponent of the
    largest multiplier.
    """
    if saturated > threshold:
        return Decision(min(shortened(multiplier, search), 1 << longest), True)
    factor = 1 if largest is None else lengthening(largest)
    if factor == 1:
        return Decision(min(multiplier, 1 << longest), False)
    return Decision(min(highest(multiplier) * factor, 1 << longest), False)
