"""Smear of frame transfer, taken off by columns.

No shutter covers the chip: a packet passes every other lit row of its column, for one row shift
each, in the two transfers together (`EmccdPixels`). With a share a = row shift / exposure a column
of signals P shows

    M_y = P_y + a (sum P - P_y),    hence    sum P = sum M / (1 + a (n - 1)),
    P_y = (M_y - a sum P) / (1 - a),

n rows of it having been lit. It is the standard correction of frame-transfer cameras, and exact for
the means as long as the light stands still, no value is clipped, and all rows that were lit are
read; lit rows that a window leaves out are missing from the sum. The shot noise of the charge that
is taken off, of variance a (sum P - P_y), stays.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["without_smear"]

Values = npt.NDArray[np.float64]


def without_smear(signal: Values, share: float) -> Values:
    """(rows, W) signal with the smear of its own columns taken off. signal: above black, in any
    unit, (rows, W), all rows that were lit. share: row shift over exposure, 0 to below 1;
    ValueError otherwise."""
    if not 0 <= share < 1:
        raise ValueError(f"share must be 0 to below 1, not {share:g}")
    total = signal.sum(axis=0) / (1 + share * (signal.shape[0] - 1))
    return np.asarray((signal - share * total) / (1 - share))
