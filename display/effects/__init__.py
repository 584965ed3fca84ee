"""The effects that the simulation of a display may leave out, with their costs and bounds."""

from display.effects.bounds import BASE_COST
from display.effects.emission import SPANS, emission_effect, planes_effect, row_timing_effect
from display.effects.weights import effective_planes, weight_steps

__all__ = [
    "BASE_COST",
    "SPANS",
    "effective_planes",
    "emission_effect",
    "planes_effect",
    "row_timing_effect",
    "weight_steps",
]
