"""Time in integer picoseconds, and clocks without drift."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import gcd, isfinite

PS = 10**12
"""Picoseconds in a second."""


def seconds_to_ps(seconds: float) -> int:
    """Nearest integer picosecond; uses the decimal text of the float, so 0.064 s is exact."""
    return round(Fraction(repr(float(seconds))) * PS)


@dataclass(frozen=True, slots=True)
class Clock:
    """A clock of `num/den` Hz. Edge k is at floor(k * 1e12 * den / num) picoseconds.

    The floor is taken of the exact rational, not of a sum of rounded periods, so clocks of 60 Hz
    and 85 MHz do not drift against each other. Cycle k lasts from edge k to edge k + 1. The
    fraction is in lowest terms, so clocks of equal frequency compare equal.
    """

    num: int
    den: int = 1

    def __post_init__(self) -> None:
        if self.num <= 0 or self.den <= 0:
            raise ValueError(f"clock frequency must be positive, not {self.num}/{self.den} Hz")
        common = gcd(self.num, self.den)
        object.__setattr__(self, "num", self.num // common)
        object.__setattr__(self, "den", self.den // common)

    @classmethod
    def from_hz(cls, hz: float) -> Clock:
        """The clock of the shortest decimal text of `hz` (29.97 is 2997/100)."""
        if not (isfinite(hz) and hz > 0):
            raise ValueError(f"clock frequency must be positive and finite, not {hz} Hz")
        exact = Fraction(repr(float(hz)))
        return cls(exact.numerator, exact.denominator)

    @property
    def hz(self) -> float:
        """The frequency, rounded to a float."""
        return self.num / self.den

    @property
    def period(self) -> Fraction:
        """Seconds in a cycle, exact."""
        return Fraction(self.den, self.num)

    def edge(self, k: int) -> int:
        """Instant of edge k in picoseconds (k may be negative)."""
        return k * PS * self.den // self.num

    def middle(self, k: int) -> int:
        """Middle of cycle k in picoseconds: the instant of an image "at cycle k"."""
        return (2 * k + 1) * PS * self.den // (2 * self.num)

    def cycle_at(self, ps: int) -> int:
        """The cycle that contains instant `ps`: the largest k with edge(k) <= ps."""
        return ((ps + 1) * self.num - 1) // (PS * self.den)

    def position(self, ps: int) -> Fraction:
        """Instant `ps` in cycles, exact; edge k is within a picosecond of position k."""
        return Fraction(ps * self.num, PS * self.den)

    def cycles_in(self, ps: int) -> int:
        """Number of cycles in a duration, rounded to the nearest."""
        return round(self.position(ps))
