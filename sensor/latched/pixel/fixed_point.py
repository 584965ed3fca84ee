"""Q24.40: charge as a 64-bit integer of 2^-40 electrons.

float32 loses a dim pixel altogether and float64 depends on the order of sums; the integer does
neither. Charge, increments and thresholds stay below 2^21 electrons, so that sums of a few
never leave 64 bits.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

__all__ = ["FRACTION_BITS", "LARGEST", "ONE", "Charge", "to_fixed"]

FRACTION_BITS: Final = 40
ONE: Final = 1 << FRACTION_BITS
"""One electron."""
LARGEST: Final = 1 << 21
"""Electrons: bound of a threshold and of what is added in a cycle. Light that brings more than
this a cycle is held at it; such a pixel fires in every cycle whatever its threshold."""

Charge = npt.NDArray[np.int64]


def to_fixed(electrons: Any) -> Charge:
    """Nearest Q24.40 to float64 `electrons`, held at LARGEST."""
    value = np.minimum(np.asarray(electrons, np.float64), LARGEST)
    return np.rint(value * float(ONE)).astype(np.int64)
