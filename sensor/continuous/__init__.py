"""Continuous photographing: pixels that report their absolute intensity when it has changed."""

from sensor.continuous.camera import ContinuousCamera

__all__ = ["ContinuousCamera"]
