"""The reference tier: an event-driven pixel in continuous time and float64.

The error of every run is measured against it.
"""

from sensor.latched.reference.pixels import ReferencePixels

__all__ = ["ReferencePixels"]
