"""Calibration of soft values (log likelihood ratios of bits) on known symbols.

The values of a cell's pixels and ticks are added as if their errors were independent. But the
neighbouring cells illuminate all of them, so the sum is too large. One factor on all soft values
corrects their mean confidence and changes neither a decision nor their order. It is the factor that
maximises the likelihood of the known bits (Guo and others, On Calibration of Modern Neural
Networks, ICML 2017, section 4.2: temperature scaling).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

_LEAST: Final = 0.1
"""Smallest factor; the largest is 1."""
_SURE: Final = 30.0
"""Magnitude of a soft value beyond which a correct decision does not constrain the factor."""
_PRIOR, _AT = 4.0, 2.0
"""Prior: _PRIOR correct soft values of magnitude _AT at factor 1."""
_ENOUGH: Final = 400_000
"""Approximate number of soft values that are used. With one wrong value in a hundred, the factor's
error is then some thousandths."""
_HALVINGS: Final = 24
"""Bisection steps: the factor is then exact to 6e-8."""


def scaling_factor(soft: npt.NDArray[np.float32], known: npt.NDArray[np.bool_]) -> float:
    """Factor in [0.1, 1] by which soft values match their error rate.

    Args:
        soft: array of log likelihood ratios, of any shape: ln P(spikes | on) - ln P(spikes | off).
        known: the bits, True for on, of the same shape.
    """
    some = slice(None, None, max(soft.size // _ENOUGH, 1) | 1)  # odd: in all symbols
    signed, known = soft.ravel()[some].astype(np.float64), known.ravel()[some]
    signed[~known] *= -1  # now positive where the decision is correct
    signed = signed[signed < _SURE]

    def slope(factor: float) -> float:
        """Derivative of the log likelihood, which is concave, by the factor."""
        gradient = (signed / (1 + np.exp(np.clip(factor * signed, -500, 500)))).sum()
        p, at = 1 / (1 + np.exp(-_AT)), 1 / (1 + np.exp(-_AT * factor))
        return float(gradient + _PRIOR * _AT * (p - at))

    if slope(1.0) >= 0:
        return 1.0
    low, high = _LEAST, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if slope(middle) > 0 else (low, middle)
    return low
