"""The relaxation of an emitter within a part of a plane, as constants for a shader."""

from __future__ import annotations

import math

from display.panels.panel import SpikePanel

LEVELS = 2**31 - 256
"""Number of steps of a stored level, whose maximum is 1 / pulse packets a cycle. An integer sums
changes that a float32 level would lose. With a time constant of n cycles, a level settles within n
/ 2 steps of its drive: the error is below 1e-6 of white up to 10 ms at any white rate above
0.05."""


def slow(panel: SpikePanel) -> bool:
    """Whether the emitter has a time constant."""
    return panel.rise > 0 or panel.decay > 0


def relaxation(constant: float, share: float, panel: SpikePanel) -> tuple[float, float, float]:
    """The coefficients (a, b, c) of a part of a plane under constant drive x, from the level y: the
    light is a x + b y, packets, and the level changes by c (x - y).

    y' = (x - y) / T, in cycles, gives b = T (1 - e^(-share / T)), a = share - b, c = b / T.

    Args:
        constant: time constant of the emitter, s.
        share: length of the part, planes.
        panel: the panel, for its clock.
    """
    if constant == 0:
        return share, 0.0, 1.0
    planes = constant * panel.clock.hz
    gone = -math.expm1(-share / planes)
    return share - planes * gone, planes * gone, gone
