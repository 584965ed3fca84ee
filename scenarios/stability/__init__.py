"""The stability suite: stiff and extreme cases, each beside a reference of its own."""

from scenarios.stability.bright import BRIGHT as _BRIGHT
from scenarios.stability.case import Case, Row
from scenarios.stability.chance import CHANCE as _CHANCE
from scenarios.stability.circuits import CIRCUITS as _CIRCUITS
from scenarios.stability.controlling import CONTROLLING as _CONTROLLING
from scenarios.stability.cutting import SAMENESS as _SAMENESS
from scenarios.stability.denormals import DENORMALS as _DENORMALS
from scenarios.stability.firing import FIRING as _FIRING
from scenarios.stability.gathering import GATHERING as _GATHERING
from scenarios.stability.linking import LINKING as _LINKING
from scenarios.stability.showing import SHOWING as _SHOWING
from scenarios.stability.solving import SOLVING as _SOLVING
from scenarios.stability.ticks import TICKS as _TICKS

__all__ = ["CASES", "Case", "Row"]

_ALL = (
    *_GATHERING, *_BRIGHT, *_CHANCE, *_FIRING, *_TICKS, *_CIRCUITS, *_SOLVING, *_DENORMALS,
    *_SAMENESS, *_SHOWING, *_LINKING, *_CONTROLLING,
)  # fmt: skip
CASES = {case.number: case for case in sorted(_ALL, key=lambda case: case.number)}
"""Every case by its number."""
