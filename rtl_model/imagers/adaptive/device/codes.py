"""Gray codes of the counters.

Each step changes one bit (document 001, section 4). A Gray code that counts fewer states than its
bits have closes on itself with one bit only when it is taken from the middle of the reflected code,
which needs an even number of states: odd ones are refused.
"""

from __future__ import annotations

__all__ = ["changed_bits", "gray", "gray_bits", "ring"]


def gray(number: int) -> int:
    """Reflected Gray code."""
    return number ^ (number >> 1)


def gray_bits(states: int) -> int:
    """Bits of a Gray counter of so many states."""
    if states < 2 or states % 2:
        raise ValueError(f"states of a Gray counter must be even, not {states}")
    return (states - 1).bit_length()


def ring(number: int, states: int) -> int:
    """Code of a Gray counter that goes from `states` - 1 back to 0, one bit a step throughout."""
    spare = (1 << gray_bits(states)) - states
    return gray(number % states + spare // 2)


def changed_bits(before: int, after: int) -> int:
    """Bits in which two codes differ."""
    return (before ^ after).bit_count()
