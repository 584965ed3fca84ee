"""Statistics of light that follows the intervals between spikes, for drives that show 1 / tau."""

from __future__ import annotations

import numpy as np

from display.drives.drive import Values

__all__ = ["interval_flutter", "interval_unsteadiness"]


def interval_flutter(rate: Values, variance: Values, reach: float) -> Values:
    """`Drive.flutter` of light 1 / tau, which stays the same for 1 / r planes.

    With weights that turn within `reach` planes an interval that lasts longer shows only its jumps,
    r reach^2 / 5: a jump anywhere in a span whose weights rise evenly.
    """
    last = np.minimum(1 / np.maximum(rate, 1e-12), rate * reach**2 / 5)
    return np.asarray(rate * np.sqrt(variance * last))


def interval_unsteadiness(rate: Values, variance: Values, motion: Values, swing: float) -> Values:
    """`Drive.unsteadiness` of light 1 / tau: sqrt(2) of its deviation, and there and back between
    the ends of its range where it moves."""
    return np.asarray(rate * (np.sqrt(2 * variance) + motion))
