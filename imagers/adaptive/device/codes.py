"""Codes of the counters: Gray, and binary for comparison.

Each step of a Gray code changes one bit (document 001, section 4). A cyclic Gray code with fewer
states than its bits allow is taken from the middle of the reflected code, which requires an even
number of states.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

__all__ = ["Code", "gray", "gray_bits", "ring"]

Code = Literal["gray", "binary"]
Number = TypeVar("Number", int, npt.NDArray[np.int64])


def gray(number: Number) -> Number:
    """Reflected Gray code."""
    return number ^ (number >> 1)


def gray_bits(states: int) -> int:
    """Bits of a Gray counter with this number of states. Raises ValueError for an odd number."""
    if states < 2 or states % 2:
        raise ValueError(f"states of a Gray counter must be even, not {states}")
    return (states - 1).bit_length()


def ring(number: Number, states: int, code: Code = "gray") -> Number:
    """Code of a cyclic counter. A Gray counter changes one bit in each step, also from the last
    state to the first; a binary one changes all bits that a carry passes."""
    if code == "binary":
        return number % states
    spare = (1 << gray_bits(states)) - states
    return gray(number % states + spare // 2)
