"""The fast tier: the synchronous pixel in 32-bit arithmetic, for whole chips in real time."""

from sensor.latched.fast.array import PixelArray
from sensor.latched.fast.bound import charge_error
from sensor.latched.fast.pixels import FastPixels

__all__ = ["FastPixels", "PixelArray", "charge_error"]
