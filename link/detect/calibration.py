"""By how much soft values promise too much, from decisions on symbols that are known.

A cell's looks are added as if they erred independently, but the cells beside light all of them
together, so the sum goes too far from 0. One factor on all soft values mends their mean promise and
changes neither a decision nor which of them is the surest; it is the one under which the known bits
are the likeliest (Guo and others, On Calibration of Modern Neural Networks, ICML 2017, section
4.2: temperature scaling).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["confidence"]

_LEAST: Final = 0.1
"""Factor, at least; the most is 1."""
_SURE: Final = 30.0
"""Size of a soft value beyond which a right decision says nothing of the factor."""
_PRIOR, _AT = 4.0, 2.0
"""Observations that the factor 1 counts for, and the size of their soft value."""
_HALVINGS: Final = 24


def confidence(soft: npt.NDArray[np.float32], known: npt.NDArray[np.bool_]) -> float:
    """Factor that makes soft values, ln P(spikes | on) - ln P(spikes | off), say how often they are
    wrong. known: bits, of soft's shape."""
    right = np.where(known, soft, -soft).astype(np.float64).ravel()
    right = right[right < _SURE]

    def slope(factor: float) -> float:
        """Of the log likelihood, which is concave, by the factor."""
        gradient = (right / (1 + np.exp(np.clip(factor * right, -500, 500)))).sum()
        p, at = 1 / (1 + np.exp(-_AT)), 1 / (1 + np.exp(-_AT * factor))
        return float(gradient + _PRIOR * _AT * (p - at))

    if slope(1.0) >= 0:
        return 1.0
    low, high = _LEAST, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if slope(middle) > 0 else (low, middle)
    return low
