"""Q24.40: charge as a 64-bit integer in units of 2^-40 electrons.

In float32 the charge of a dim pixel is lost to rounding, and float64 sums depend on their order;
integers avoid both. Charge, increments and thresholds stay below 2^21 electrons, so sums of a few
of them do not overflow.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

FRACTION_BITS: Final = 40
ONE: Final = 1 << FRACTION_BITS
"""Unit of one electron."""
LARGEST: Final = 1 << 21
"""Upper limit in electrons of a threshold, and of the charge that a cycle adds. Brighter light is
clipped to it; such a pixel fires in every cycle, whatever its threshold."""

Charge = npt.NDArray[np.int64]


def to_fixed(electrons: Any) -> Charge:
    """Nearest Q24.40 to float64 `electrons`, clipped to LARGEST."""
    value = np.minimum(np.asarray(electrons, np.float64), LARGEST)
    return np.rint(value * float(ONE)).astype(np.int64)
