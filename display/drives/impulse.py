"""Impulse: each spike emits its packet in its own plane. x = 1 where age = 0, else 0."""

from __future__ import annotations

from typing import Any

import numpy as np

from display.drives.drive import Drive, Values

__all__ = ["IMPULSE"]


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return (age == 0) * 1.0


def _flutter(rate: Values, variance: Values, reach: float) -> Values:
    """A plane has a packet or none: r (1 - r), planes apart."""
    return np.asarray(np.sqrt(rate * np.maximum(1 - rate, 0.1)))


def _unsteadiness(rate: Values, variance: Values, motion: Values, swing: float) -> Values:
    """The emitter goes up and down with each packet."""
    return np.full_like(rate, 2 * swing)


IMPULSE = Drive("impulse", 0, _level, "vec4(fired)", _flutter, _unsteadiness)
