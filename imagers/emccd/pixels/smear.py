"""Correction of frame-transfer smear, column by column.

No shutter covers the chip: a packet passes every other lit row of its column, for one row shift
each, in the two transfers together (`EmccdPixels`). With a share a = row shift / exposure a column
of signals P shows

    M_y = P_y + a (sum P - P_y),    hence    sum P = sum M / (1 + a (n - 1)),
    P_y = (M_y - a sum P) / (1 - a),

for n lit rows. This is the standard correction of frame-transfer cameras. It is exact for the means
if the light is constant, no value is clipped, and all lit rows are read; lit rows outside a window
are missing from the sum. The shot noise of the subtracted charge, of variance a (sum P - P_y),
remains.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["without_smear"]

Values = npt.NDArray[np.float64]


def without_smear(signal: Values, share: float) -> Values:
    """(rows, W) signal without smear. signal: above black, in any unit, (rows, W), all lit rows.
    share: row shift over exposure, 0 to below 1; ValueError otherwise."""
    if not 0 <= share < 1:
        raise ValueError(f"share must be 0 to below 1, not {share:g}")
    total = signal.sum(axis=0) / (1 + share * (signal.shape[0] - 1))
    return np.asarray((signal - share * total) / (1 - share))
