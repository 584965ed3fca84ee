"""The asynchronous spike camera: pixels that fire when they are full, not when a clock asks."""

from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.pixels import AsynchronousPixels, EventPixels

__all__ = ["AsynchronousPixels", "EventModel", "EventPixels", "Firings", "latched"]
