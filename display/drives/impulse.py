"""Impulse: each spike emits a packet in its own plane. x = 1 if age = 0, else 0."""

from __future__ import annotations

from typing import Any, Final

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


def _rest_level(age: Any, tau: Any, memory: Any) -> Any:
    return (age == 0) * memory


def _rest(memory: Any, interval: Any, emitted: Any) -> Any:
    """Size of a packet: `emitted` is that of the packet before, `memory`, and of the charges shown
    since then."""
    return np.minimum(np.maximum(1.0 + memory - emitted, 0.0), 1.0)


_RESIDUE: Final = Drive(
    "impulse", 1, _rest_level, "vec4(fired) * memory", _fluctuation, _variation, _rest,
    "clamp(memory + 1.0 - emitted, 0.0, 1.0)",
)  # fmt: skip
IMPULSE = Drive("impulse", 0, _level, "vec4(fired)", _fluctuation, _variation, residue=_RESIDUE)
