"""The asynchronous spike camera: pixels that fire when they are full, not when a clock asks."""

from sensor.asynchronous.model import EventModel, latched
from sensor.asynchronous.pixel.array import AsynchronousPixels

__all__ = ["AsynchronousPixels", "EventModel", "latched"]
