"""Spans of planes that are shown as one: the timing of spikes within a span."""

from __future__ import annotations

from typing import Final

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import promise
from display.effects.costs import SPAN_COST
from display.effects.weights import span_change
from display.observe.views import Observer
from display.panels.panel import SpikePanel

__all__ = ["SPANS", "planes_effect"]

SPANS: Final = (1, 8, 64)
"""Planes to a span, from everything to what a draw holds."""


def planes_effect(panel: SpikePanel, observer: Observer, fine: int, coarse: int) -> Effect:
    """That spans of `coarse` planes are resolved to spans of `fine`.

    Left out, every plane of a span gets the span's mean weight and its middle's place on the
    retina: the changes of `weighing.py` (1) to (3), and `travel`. Costs are of one group, so that
    leaving out the coarser alone saves nothing: it goes only where the finer does.
    """

    def bound(scene: Summary) -> Bound:
        change = span_change(observer, panel, scene.cycles, fine, coarse)
        return promise(scene, panel, observer, change, coarse)

    source = "an image is the response times light, integrated: its change by means over spans"
    return Effect(
        f"planes within {coarse}", source, Stream.NONE, bound,
        lambda scene: SPAN_COST[fine], group="planes",
    )  # fmt: skip
