"""Statistics of the light of drives that follow the intervals between spikes, 1 / tau."""

from __future__ import annotations

import numpy as np

from display.drives.drive import Values

__all__ = ["interval_fluctuation", "interval_variation"]


def interval_fluctuation(rate: Values, variance: Values, reach: float) -> Values:
    """`Drive.fluctuation` of the light 1 / tau, which is constant for 1 / r planes.

    If the weights change their sign within `reach` planes, a longer interval contributes only its
    steps, r reach^2 / 5: a step at a random position of a span with linearly rising weights.
    """
    last = np.minimum(1 / np.maximum(rate, 1e-12), rate * reach**2 / 5)
    return np.asarray(rate * np.sqrt(variance * last))


def interval_variation(rate: Values, variance: Values, motion: Values, swing: float) -> Values:
    """`Drive.variation` of the light 1 / tau: sqrt(2) times its standard deviation, plus the
    range of its motion."""
    return np.asarray(rate * (np.sqrt(2 * variance) + motion))
