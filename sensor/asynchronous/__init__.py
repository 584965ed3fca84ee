"""The asynchronous spike camera: pixels that fire when they are full, not when a clock asks."""

from sensor.asynchronous.closed import is_steady
from sensor.asynchronous.effects import SIDE, EventEffect, EventScene, event_effects, summarise
from sensor.asynchronous.law import WeakError, weak_error
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.pixels import AsynchronousPixels, EventPixels
from sensor.asynchronous.plan import EventPlan, PlannedPixels, make_plan
from sensor.asynchronous.reference import Followed, follow, quantile_error

__all__ = [
    "SIDE",
    "AsynchronousPixels",
    "EventEffect",
    "EventModel",
    "EventPixels",
    "EventPlan",
    "EventScene",
    "Firings",
    "Followed",
    "PlannedPixels",
    "WeakError",
    "event_effects",
    "follow",
    "is_steady",
    "latched",
    "make_plan",
    "quantile_error",
    "summarise",
    "weak_error",
]
