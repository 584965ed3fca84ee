"""The interface of drives, by which a pixel of a spike-continuous panel converts spikes to
light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]


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
            AGE: planes since the last spike, as above; `memory`.
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
    """

    name: str
    spikes: int
    level: Callable[[Any, Any, Any], Any]
    glsl: str
    fluctuation: Callable[[Values, Values, float], Values]
    variation: Callable[[Values, Values, Values, float], Values]
    remember: Callable[[Any, Any, Any], Any] | None = None
    glsl_remember: str = ""
