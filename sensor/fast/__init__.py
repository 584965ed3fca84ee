"""The fast tier: the synchronous pixel in 32 bits, for whole chips in real time."""

from sensor.fast.bound import charge_error, rate_bound
from sensor.fast.pixels import FastPixels
from sensor.fast.plain import PlainFast
from sensor.fast.units import units_of

__all__ = ["FastPixels", "PlainFast", "charge_error", "rate_bound", "units_of"]
