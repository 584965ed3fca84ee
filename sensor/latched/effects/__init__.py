"""The physical effects of the latched pixel, one file each, and their catalogue."""

from sensor.latched.effects.catalogue import EFFECTS
from sensor.latched.effects.metastability import Metastability
from sensor.latched.effects.residual import RESIDUAL
from sensor.latched.effects.shot_noise import SHOT_NOISE

__all__ = ["EFFECTS", "RESIDUAL", "SHOT_NOISE", "Metastability"]
