"""The order of error against tolerance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["fit_order"]

_CLEAR = 3.0
"""Times the error at tolerance 0 beyond which an error is the tolerance's."""


def fit_order(points: Sequence[tuple[float, float]], floor: float = 0.0) -> float | None:
    """Exponent e of error = C tolerance^e by least squares in logarithms. points: (tolerance,
    error), of which those count that have both and lie well above `floor`; None of fewer than
    three different tolerances."""
    told = [(t, e) for t, e in points if t > 0 and e > max(_CLEAR * floor, 0.0)]
    if len({t for t, _ in told}) < 3:
        return None
    x, y = np.log(told).T
    return float(np.polyfit(x, y, 1)[0])
