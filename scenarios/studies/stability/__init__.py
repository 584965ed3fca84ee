"""The stability suite: stiff and extreme cases, each compared with an independent reference."""

from display.stability import SHOWING as _SHOWING
from imagers.stability import CONTROLLING as _CONTROLLING
from link.stability import LINKING as _LINKING
from sensor.stability.bright import BRIGHT as _BRIGHT
from sensor.stability.chance import CHANCE as _CHANCE
from sensor.stability.circuits import CIRCUITS as _CIRCUITS
from sensor.stability.cutting import SAMENESS as _SAMENESS
from sensor.stability.denormals import DENORMALS as _DENORMALS
from sensor.stability.firing import FIRING as _FIRING
from sensor.stability.gathering import GATHERING as _GATHERING
from sensor.stability.solving import SOLVING as _SOLVING
from sensor.stability.ticks import TICKS as _TICKS

__all__ = ["CASES"]

_ALL = (
    *_GATHERING, *_BRIGHT, *_CHANCE, *_FIRING, *_TICKS, *_CIRCUITS, *_SOLVING, *_DENORMALS,
    *_SAMENESS, *_SHOWING, *_LINKING, *_CONTROLLING,
)  # fmt: skip
CASES = {case.number: case for case in sorted(_ALL, key=lambda case: case.number)}
"""All cases by their numbers."""
