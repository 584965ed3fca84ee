"""Statistics of the light of drives that follow the intervals between spikes, 1 / tau."""

from __future__ import annotations

import numpy as np

from display.drives.drive import Values

__all__ = ["interval_fluctuation", "interval_variation"]


def interval_fluctuation(rate: Values, variance: Values, reach: float) -> Values:
    """`Drive.fluctuation` of the light 1 / tau, which is constant for 1 / r planes.

    The observer's weights can change sign within `reach` planes. Within an interval that is longer
    than `reach` the light is constant and its weights cancel, so only the steps between intervals
    contribute: r reach^2 / 5, the mean over steps at random positions of a span with linearly
    rising weights.
    """
    last = np.minimum(1 / np.maximum(rate, 1e-12), rate * reach**2 / 5)
    return np.asarray(rate * np.sqrt(variance * last))


def interval_variation(rate: Values, variance: Values, motion: Values, swing: float) -> Values:
    """`Drive.variation` of the light 1 / tau: sqrt(2) times its standard deviation, plus the
    range of its motion."""
    return np.asarray(rate * (np.sqrt(2 * variance) + motion))
