"""The physical effects of the pixel, one file each."""

from sensor.latched.effects.circuit import leak_effect, overshoot_effect
from sensor.latched.effects.crosstalk import crosstalk_effect
from sensor.latched.effects.dead_time import dead_time_effect
from sensor.latched.effects.fixed_pattern import pattern_effects
from sensor.latched.effects.initial_charge import INITIAL_CHARGE, initial_deficit
from sensor.latched.effects.metastability import Metastability, metastability_effect
from sensor.latched.effects.residual import RESIDUAL
from sensor.latched.effects.sampling import comparator_delay_effect, row_sampling_effect
from sensor.latched.effects.shot_noise import SHOT_NOISE, first_thresholds, thresholds
from sensor.latched.effects.threshold_noise import ktc_electrons, threshold_noise_effect

__all__ = [
    "EFFECTS",
    "INITIAL_CHARGE",
    "RESIDUAL",
    "SHOT_NOISE",
    "Metastability",
    "comparator_delay_effect",
    "crosstalk_effect",
    "dead_time_effect",
    "first_thresholds",
    "initial_deficit",
    "ktc_electrons",
    "leak_effect",
    "metastability_effect",
    "overshoot_effect",
    "pattern_effects",
    "row_sampling_effect",
    "threshold_noise_effect",
    "thresholds",
]

EFFECTS = {e.name: e for e in (RESIDUAL, INITIAL_CHARGE, SHOT_NOISE)}
"""The effects that every pixel has, by name, in the order reports print them; what a device adds
of its own is made from its setting (`CameraSetting.kept`)."""
