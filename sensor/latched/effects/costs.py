"""What effects cost, in nanoseconds a pixel-cycle: the order in which the planner leaves them out.

Measured on two cores at 2.5 GHz with AVX-512 under PoCL 3.1 by `viform bench sensor`. The choice
between effects goes by this table and not by the machine at hand, so that one scenario gives the
same bits everywhere; predicted times are measured on the device.
"""

from __future__ import annotations

from typing import Any, Final

from cosim.plan.effects import Summary

__all__ = [
    "QUIET",
    "circuit_cost",
    "crosstalk_cost",
    "dead_time_cost",
    "noise_cost",
    "pattern_cost",
    "sampling_cost",
]

QUIET: Final = 0.03
"""A pixel-cycle without noise: phase and carry."""
NOISE_SPIKE: Final = 4.0
"""A spike with a threshold of its own."""
NOISE_CYCLE: Final = 0.01
"""What noise costs where nothing fires: the estimate of the next spike, over a block."""
DEAD_SPIKE: Final = 0.5
"""Dead time, a spike."""
PATTERN_PLANE: Final = 0.3
"""Gain and dark charge, a pixel of a new plane of light."""
SAMPLING_PLANE: Final = 1.0
"""Rows of their own in the cycle in which planes meet, a pixel of a new plane."""
CROSSTALK_PLANE: Final = 8.0
"""Nine neighbours, a pixel of a new plane."""


def _rate(scene: Summary) -> Any:
    """Spikes a cycle, about."""
    return (scene.darkest + scene.brightest) / 2 / scene.threshold


def noise_cost(scene: Summary) -> Any:
    """Thresholds drawn for each spike."""
    return NOISE_CYCLE + NOISE_SPIKE * _rate(scene)


def dead_time_cost(scene: Summary) -> Any:
    """Charge lost at each spike."""
    return 1e-3 + DEAD_SPIKE * _rate(scene)


def pattern_cost(scene: Summary) -> Any:
    """A device's own gains and dark currents."""
    return 1e-6 + PATTERN_PLANE * scene.planes


def sampling_cost(scene: Summary) -> Any:
    """Rows that are sampled at instants of their own."""
    return 1e-6 + SAMPLING_PLANE * scene.planes


def crosstalk_cost(scene: Summary) -> Any:
    """Light of neighbours."""
    return 1e-6 + CROSSTALK_PLANE * scene.planes


def circuit_cost(scene: Summary) -> Any:
    """A circuit in its lumped form: a sum that is made anyway."""
    return 1e-6
