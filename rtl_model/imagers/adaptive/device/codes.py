"""Gray codes of the counters.

Each step changes one bit (document 001, section 4). A cyclic Gray code with fewer states than its
bits allow is taken from the middle of the reflected code, which requires an even number of states.
"""

from __future__ import annotations

__all__ = ["changed_bits", "gray", "gray_bits", "ring"]


def gray(number: int) -> int:
    """Reflected Gray code."""
    return number ^ (number >> 1)


def gray_bits(states: int) -> int:
    """Bits of a Gray counter with this number of states. Raises ValueError for an odd number."""
    if states < 2 or states % 2:
        raise ValueError(f"states of a Gray counter must be even, not {states}")
    return (states - 1).bit_length()


def ring(number: int, states: int) -> int:
    """Code of a cyclic Gray counter: it changes one bit in each step, also from the last state to
    the first."""
    spare = (1 << gray_bits(states)) - states
    return gray(number % states + spare // 2)


def changed_bits(before: int, after: int) -> int:
    """Number of bits in which two codes differ."""
    return (before ^ after).bit_count()
