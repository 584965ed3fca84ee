"""The physical effects of the pixel, one file each."""

from sensor.effects.initial_charge import INITIAL_CHARGE, initial_deficit
from sensor.effects.residual import RESIDUAL
from sensor.effects.shot_noise import SHOT_NOISE, first_thresholds

__all__ = [
    "EFFECTS",
    "INITIAL_CHARGE",
    "RESIDUAL",
    "SHOT_NOISE",
    "first_thresholds",
    "initial_deficit",
]

EFFECTS = {e.name: e for e in (RESIDUAL, INITIAL_CHARGE, SHOT_NOISE)}
"""Every effect by name, in the order reports print them."""
