"""The effects that the simulation of a display may leave out, with their costs and bounds."""

from display.effects.costs import SHOWN
from display.effects.emission import emission_effect
from display.effects.rows import row_timing_effect
from display.effects.spans import SPANS, planes_effect
from display.effects.weights import effective_planes

__all__ = [
    "SHOWN",
    "SPANS",
    "effective_planes",
    "emission_effect",
    "planes_effect",
    "row_timing_effect",
]
