"""The charge that an exact pixel is given over a number of cycles."""

from __future__ import annotations

from dataclasses import dataclass

from sensor.latched.pixel.fixed_point import Charge

__all__ = ["Span"]


@dataclass(frozen=True, eq=False)
class Span:
    """Charge that falls in cycles `first` to `first + cycles` of a block's words.

    charge: Q24.40 of the cycle where this course of light began, (n,) int64 >= 0. slope: its
    change a cycle, or None. elapsed: cycles between that one and `first`, so that the same arrays
    serve every block and every split of the run.
    """

    first: int
    cycles: int
    charge: Charge
    slope: Charge | None = None
    elapsed: int = 0
