"""The fast tier: the synchronous pixel in 32 bits, for whole chips in real time."""

from sensor.latched.fast.bound import charge_error, rate_bound
from sensor.latched.fast.pixels import FastPixels
from sensor.latched.fast.units import units_of

__all__ = ["FastPixels", "charge_error", "rate_bound", "units_of"]
