"""The interface of drives, by which a pixel of a spike-continuous panel converts spikes to light,
and what drives that hold the rate of the last interval have in common.

The rate 1 / tau is a biased estimate: a short interval is held for the longer one that follows, so
its mean over time exceeds the mean rate (at 0.6 spikes a cycle it is 0.7). A drive of this kind
therefore keeps a balance of the packets that it owes: one for each past spike, less the light
emitted. Of the balance it repays `SHARE` per interval. Its light then differs from its spikes by a
few packets, however long it is on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba.extending import register_jitable

Values = npt.NDArray[np.float64]
SHARE: Final = 0.25
"""Share of the balance that is repaid per interval. A larger share increases the flutter; a smaller
share needs a wider balance for the largest bias, 1.25 at two spikes in three cycles."""
LEAST: Final = -3 * SHARE
MOST: Final = SHARE
"""Limits of the repayment, packets: of a balance from -3 to 1. A pixel does not go dark, or flare,
to settle the balance of a sudden change of light."""
GLSL_LEVEL: Final = "min({rate} + memory * {rate}, 1.0)"
"""`packets_at` in GLSL; rate: 1 / planes."""
GLSL_REPAID: Final = f"clamp(memory + {SHARE} - {SHARE} * emitted, {LEAST}, {MOST})"
"""`repaid` in GLSL."""


@dataclass(frozen=True)
class Drive:
    """A drive of a spike-continuous panel.

    A drive is event-driven: its memory changes with a spike, and between spikes its level is a
    closed form of the number of planes since the last spike. `level` and `remember` are
    elementwise. The golden model calls them with arrays of pixels, compiled kernels with the values
    of one pixel, so they consist of arithmetic and numpy's elementwise functions, without branches.

    Attributes:
        name: name in a scenario.
        spikes: number of past spikes on which the level depends. 0: the light of a spike is its
            packet, emitted in the plane of the spike. 1, 2: dark before the first, the second
            spike.
        level: (age, tau, memory) -> packets of light Q a cycle, 0 to 1. age: planes since the last
            spike, 0 in its own plane. tau: planes between the last two spikes. memory: result of
            `remember`.
        glsl: `level` in GLSL, a vec4 of four pixels. `fired`: uvec4, 1 where a spike is in this
            plane. With `spikes` > 0 also `held`: 1 / tau, 0 before the second spike; `run`: planes
            since the last spike before this plane, infinite before the first; `inverse`: 1 / run;
            AGE: planes since the last spike, as above; `memory`. It is compiled as OpenCL C too
            (display/render/planes.cl): arithmetic, min, max, clamp, pow and vec4(number), without
            comparisons. The first argument of min, max and clamp is a vector.
        fluctuation: (rate, variance, reach) -> standard deviation of the light of a plane, times
            the root of the number of planes for which it is constant, packets. rate: spikes a
            cycle. variance: variance of 1 / tau over the squared rate. reach: number of planes
            within which the weights of an observer change their sign.
        variation: (rate, variance, motion, swing) -> total variation of the light for each
            spike, packets. motion: range of the light over its mean if it moves, else 0. swing:
            change of the emitter's level by a packet.
        remember: (memory, interval, emitted) -> memory after a spike, 0 before the first. interval:
            planes since the previous spike, 0 at the first. emitted: sum of the levels since then,
            packets. None: no memory.
        glsl_remember: `remember` in GLSL, of `memory`, `run` and `emitted`.
        residue: the drive for a stream with planes of charges, where it is another one: its packet
            is what they have not shown of it.
    """

    name: str
    spikes: int
    level: Callable[[Any, Any, Any], Any]
    glsl: str
    fluctuation: Callable[[Values, Values, float], Values]
    variation: Callable[[Values, Values, Values, float], Values]
    remember: Callable[[Any, Any, Any], Any] | None = None
    glsl_remember: str = ""
    residue: Drive | None = None


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
