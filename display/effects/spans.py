"""The effect of spans: planes that are shown as one, without the timing of spikes within a span."""

from __future__ import annotations

from typing import Final

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import SPAN_COST, promise
from display.effects.weights import span_change
from display.observe.views import Observer
from display.panels.panel import SpikePanel

SPANS: Final = (1, 8, 64)
"""Numbers of planes in a span, from the full resolution to the planes of a draw call."""


def planes_effect(panel: SpikePanel, observer: Observer, fine: int, coarse: int) -> Effect:
    """The resolution of spans of `coarse` planes to spans of `fine` planes.

    Without this effect, every plane of a span has the mean weight of the span and the position of
    its middle on the retina: equations (1) to (3) of `weights.py`, and `travel`. The costs form one
    group: to leave out only the coarser resolution saves nothing.
    """

    def bound(scene: Summary) -> Bound:
        change = span_change(observer, panel, scene.cycles, fine, coarse)
        return promise(scene, panel, observer, change, coarse)

    source = "an image is the response times light, integrated: its change by means over spans"
    return Effect(
        f"planes within {coarse}", source, Stream.NONE, bound,
        lambda scene: SPAN_COST[fine], group="planes",
    )  # fmt: skip
