"""What a drive provides: how a pixel of a spike-continuous panel makes light of its spikes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Drive"]

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """A drive of a spike-continuous panel.

    A drive is event-driven: what it remembers changes with a spike, and between spikes its level
    is a closed form of the planes since the last spike. `level` and `remember` are elementwise. The
    golden model calls them with arrays of pixels, compiled kernels with the numbers of one pixel,
    so they consist of arithmetic and numpy's elementwise functions, and do not branch.

    Attributes:
        name: in a scenario.
        spikes: spikes of the past that the level depends on. 0: the light of a spike is its packet,
            emitted in the spike's own plane. 1, 2: dark before the first, the second spike.
        level: (age, tau, memory) -> packets of light Q a cycle, 0 to 1. age: planes since the last
            spike, 0 in the spike's own plane. tau: planes between the last two spikes. memory: what
            `remember` returned.
        glsl: `level` in GLSL, a vec4 of four pixels. `fired`: uvec4, 1 where a spike is in this
            plane. With `spikes` > 0 also `held`: 1 / tau, 0 before the second spike; `run`: planes
            since the last spike before this plane, infinite before the first; `inverse`: 1 / run;
            AGE: planes since the last spike, as above; `memory`.
        flutter: (rate, variance, reach) -> standard deviation of a plane's light about its mean,
            times the root of the planes for which it stays the same, packets. rate: spikes a cycle.
            variance: of 1 / tau over rate, squared. reach: planes within which the weights of an
            observer turn.
        unsteadiness: (rate, variance, motion, swing) -> how far the light goes up and down with
            each spike, packets. motion: range of the light over its mean where it moves, else 0.
            swing: of the emitter with a packet.
        remember: (memory, tau, interval) -> memory after a spike, 0 before the first. tau: before
            this spike. interval: planes since the spike before, 0 at the first. None: no memory.
        glsl_remember: `remember` in GLSL, of `memory`, `held` (before this spike) and `run`.
    """

    name: str
    spikes: int
    level: Callable[[Any, Any, Any], Any]
    glsl: str
    flutter: Callable[[Values, Values, float], Values]
    unsteadiness: Callable[[Values, Values, Values, float], Values]
    remember: Callable[[Any, Any, Any], Any] | None = None
    glsl_remember: str = ""
