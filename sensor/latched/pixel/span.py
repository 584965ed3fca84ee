"""The charge that an exact pixel receives over a number of cycles."""

from __future__ import annotations

from dataclasses import dataclass

from sensor.latched.pixel.fixed_point import Charge


@dataclass(frozen=True, eq=False)
class Span:
    """Charge in cycles `first` to `first + cycles` of a block, constant or linear in time.

    The charge of cycle c is charge + slope x (c - first + elapsed).

    Attributes:
        first: first cycle, within the block.
        cycles: number of cycles.
        charge: (n,) int64 >= 0, Q24.40 in the cycle in which this course of light began.
        slope: (n,) int64, its change a cycle; None if constant.
        elapsed: cycles from that cycle to `first`, so that all blocks share the arrays.
    """

    first: int
    cycles: int
    charge: Charge
    slope: Charge | None = None
    elapsed: int = 0
