"""Drives that hold the rate of the last interval: the balance of their light, and its statistics.

The rate 1 / tau is a biased estimate: a short interval is held for the longer one that follows, so
its mean over time exceeds the mean rate (at 0.6 spikes a cycle it is 0.7). A drive of this kind
therefore keeps a balance of the packets that it owes: one for each past spike, less the light
emitted. Of the balance it repays `SHARE` per interval. Its light then differs from its spikes by a
few packets, however long it is on.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numba.extending import register_jitable

from display.drives.drive import Values

SHARE: Final = 0.25
"""Share of the balance that is repaid per interval. A larger share increases the flutter; a smaller
share needs a wider balance for the largest bias, 1.25 at two spikes in three cycles."""
LEAST: Final = -3 * SHARE
MOST: Final = SHARE
"""Limits of the repayment, packets: of a balance from -3 to 1. A pixel does not go dark, or flare,
to settle the balance of a sudden change of light."""


@register_jitable
def packets_at(planes: Any, memory: Any) -> Any:
    """Level at which a packet and the repayment `memory` are emitted in this number of planes, at
    most a packet in a plane."""
    return np.minimum((1.0 + memory) / planes, 1.0)


def repaid(memory: Any, interval: Any, emitted: Any) -> Any:
    """`Drive.remember`: the repayment, packets, after a spike. The spike before owed one packet,
    and `emitted` was paid. The first spike adds one as well, which the upper limit cuts at the
    second."""
    return np.minimum(np.maximum(memory + SHARE - SHARE * emitted, LEAST), MOST)


GLSL_LEVEL: Final = "min({rate} + memory * {rate}, 1.0)"
"""`packets_at` in GLSL; rate: 1 / planes."""
GLSL_REPAID: Final = f"clamp(memory + {SHARE} - {SHARE} * emitted, {LEAST}, {MOST})"
"""`repaid` in GLSL."""


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
