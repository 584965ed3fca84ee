"""How an emitter follows its drive within a part of a plane, as three numbers a shader needs."""

from __future__ import annotations

import math

from display.panels.panel import SpikePanel

__all__ = ["LEVELS", "relaxation", "slow"]

LEVELS = 2**31 - 256
"""Steps of a stored level, 1 / pulse packets a cycle at most: an integer adds up what a float32
level would lose. A slow constant of n cycles settles within n / 2 steps of its drive: 1e-6 of white
holds up to 10 ms at any white rate above 0.05 a cycle."""


def slow(panel: SpikePanel) -> bool:
    """Whether the emitter does not follow at once."""
    return panel.rise > 0 or panel.decay > 0


def relaxation(constant: float, share: float, panel: SpikePanel) -> tuple[float, float, float]:
    """(a, b, c) of a part `share` of a plane under constant drive x, with the level y before it and
    the emitter's time constant in seconds: light a x + b y, in packets; the level moves on by
    c (x - y).

    y' = (x - y) / T in cycles gives b = T (1 - e^(-share / T)), a = share - b, c = b / T.
    """
    if constant == 0:
        return share, 0.0, 1.0
    planes = constant * panel.clock.hz
    gone = -math.expm1(-share / planes)
    return share - planes * gone, planes * gone, gone
