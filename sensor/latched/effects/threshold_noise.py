"""Threshold noise: reset (kTC) and comparator noise, drawn anew for each spike.

Its normal variate is added to the shot noise's Gamma variate in the same draw (pixel/interval.py),
so it costs nothing beside it. sqrt(kTC) is 28.4 electrons at 5 fF and 300 K.
"""

from __future__ import annotations

import math

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import noise_cost
from sensor.latched.effects.windows import made, noisy, shifted

__all__ = ["BOLTZMANN", "ELEMENTARY_CHARGE", "ktc_electrons", "threshold_noise_effect"]

BOLTZMANN = 1.380649e-23
"""J/K, exact by definition of the SI (2019)."""
ELEMENTARY_CHARGE = 1.602176634e-19
"""C, exact by definition of the SI (2019)."""


def ktc_electrons(farad: float, kelvin: float = 300.0) -> float:
    """Reset noise of a capacitance in electrons: sqrt(k T C) / q."""
    return math.sqrt(BOLTZMANN * kelvin * farad) / ELEMENTARY_CHARGE


def threshold_noise_effect(sigma: float) -> Effect:
    """sigma: standard deviation in electrons."""

    def bound(scene: Summary) -> Bound:
        # Independent draws of mean zero: over n intervals the count's spread is sqrt(n) sigma / Q.
        # Until then the spikes have walked away from their draws by the root of their number.
        spread = sigma / scene.threshold
        walked = spread * np.sqrt(scene.brightest / scene.threshold * scene.cycles)
        return made(scene, noisy(scene, spread) + shifted(scene, walked), False)

    source = "kTC: Johnson, Phys. Rev. 32:97, 1928; 0.5 to 1 % of Q fits a public recording"
    return Effect(
        "threshold noise", source, Stream.SHOT_NOISE, "", str, bound, noise_cost, "tile", "noise"
    )
