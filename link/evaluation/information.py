"""Information that soft values carry of the bits that were sent.

Generalised mutual information (Kaplan and Shamai, Information rates and error exponents of
compound channels, 1993; for bits: Martinez and others, IEEE Trans. IT 55:3275, 2009): what a
decoder can get that takes the soft values, times one factor, for log likelihood ratios. It is
1 - E log2(1 + e^(-s L x)), x = 1 for on and -1 for off, at the best factor s.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

__all__ = ["information_of"]

_LEAST, _MOST, _ROUNDS = 0.05, 4.0, 16
"""Range of the factor, and steps of the search for the best one."""


def information_of(soft: npt.NDArray[np.float32], sent: npt.NDArray[np.bool_]) -> float:
    """Returns the information of a bit, bits; at most 1, and 0 or below if the values mislead.

    Args:
        soft: log likelihood ratios ln P(spikes | on) - ln P(spikes | off).
        sent: the bits, of the same shape, half of them on.
    """
    right = np.where(sent, soft, -soft).astype(np.float64).ravel()

    def at(factor: float) -> float:
        return 1 - float(np.mean(np.logaddexp(0, -factor * right))) / math.log(2)

    # Concave in the factor: golden-section search.
    low, high, part = _LEAST, _MOST, (math.sqrt(5) - 1) / 2
    for _ in range(_ROUNDS):
        a, b = high - part * (high - low), low + part * (high - low)
        low, high = (a, high) if at(a) < at(b) else (low, b)
    return at((low + high) / 2)
