"""The reference tier: the pixel event by event in continuous time and float64, the truth that every
figure of accuracy is measured against."""

from sensor.latched.reference.pixels import ReferencePixels

__all__ = ["ReferencePixels"]
