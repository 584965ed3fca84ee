"""Impulse: each spike emits a packet in its own plane. x = 1 if age = 0, else 0."""

from __future__ import annotations

from typing import Any

import numpy as np

from display.drives.drive import Drive, Values


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return (age == 0) * 1.0


def _fluctuation(rate: Values, variance: Values, reach: float) -> Values:
    """A plane has one packet or none: the variance is r (1 - r), independent between planes."""
    return np.asarray(np.sqrt(rate * np.maximum(1 - rate, 0.1)))


def _variation(rate: Values, variance: Values, motion: Values, swing: float) -> Values:
    """The level of the emitter rises and falls with each packet."""
    return np.full_like(rate, 2 * swing)


IMPULSE = Drive("impulse", 0, _level, "vec4(fired)", _fluctuation, _variation)
