"""Costs of effects in nanoseconds a pixel-cycle, by which the planner decides what to leave out.

They were measured by `viform bench sensor` on two cores at 2.5 GHz with AVX-512 under PoCL 3.1. The
planner uses this table on every machine, so that a scenario gives the same bits everywhere.
Predicted run times are measured on the device.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from cosim.plan.effects import Summary

QUIET: Final = 0.03
"""A pixel-cycle without effects: phase and carry."""
NOISE_SPIKE: Final = 4.0
"""Threshold noise, a spike: one draw."""
NOISE_CYCLE: Final = 0.01
"""Threshold noise, a cycle without spikes: the estimate of the next spike, over a block."""
BANK_FROM: Final = 5e-4
"""Spikes a cycle from which thresholds from the bank cost less than one draw for each spike. They
cost the same at all rates."""
DEAD_SPIKE: Final = 0.5
"""Dead time, a spike."""
PATTERN_PLANE: Final = 0.3
"""Gain and dark charge, a pixel of a new plane of light."""
SAMPLING_PLANE: Final = 1.0
"""Row-wise sums in the cycle in which planes meet, a pixel of a new plane."""
CROSSTALK_PLANE: Final = 8.0
"""Nine neighbours, a pixel of a new plane."""


EXACT: Final = 6.0
"""A pixel-cycle of the exact tier, whatever its effects."""
REFERENCE_CYCLE: Final = 4.0
"""The reference tier, a cycle without spikes."""
REFERENCE_SPIKE: Final = 60.0
"""The reference tier, a spike."""
REFERENCE_CIRCUIT: Final = 1000.0
"""The reference tier, a cycle of a pixel whose circuit it integrates."""
REFERENCE_MOST: Final = 6.0
"""Most spikes a cycle that the reference simulates one by one."""


def _rate(scene: Summary) -> Any:
    """Approximate spikes a cycle."""
    return (scene.darkest + scene.brightest) / 2 / scene.threshold


def noise_cost(scene: Summary) -> Any:
    """Cost of a threshold drawn for each spike."""
    return NOISE_CYCLE + NOISE_SPIKE * _rate(scene)


def bank_cost(scene: Summary) -> Any:
    """Cost of a threshold for each spike from the bank, where that is cheaper than a draw."""
    return np.minimum(noise_cost(scene), NOISE_CYCLE + NOISE_SPIKE * BANK_FROM)


def dead_time_cost(scene: Summary) -> Any:
    """Cost of charge lost at each spike."""
    return 1e-3 + DEAD_SPIKE * _rate(scene)


def pattern_cost(scene: Summary) -> Any:
    """Cost of a gain and a dark current of each pixel."""
    return 1e-6 + PATTERN_PLANE * scene.planes


def sampling_cost(scene: Summary) -> Any:
    """Cost of a sampling instant of each row."""
    return 1e-6 + SAMPLING_PLANE * scene.planes


def crosstalk_cost(scene: Summary) -> Any:
    """Cost of the light of neighbours."""
    return 1e-6 + CROSSTALK_PLANE * scene.planes


def reference_cost(scene: Summary) -> Any:
    """Cost of full physics."""
    return REFERENCE_CYCLE + REFERENCE_SPIKE * np.minimum(_rate(scene), REFERENCE_MOST)


def circuit_cost(scene: Summary) -> Any:
    """Cost of a lumped circuit: it is part of sums that are computed anyway."""
    return 1e-6
