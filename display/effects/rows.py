"""The effect of row timing: rows are shown one after another."""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import ROWS, promise
from display.effects.weights import delay_change
from display.observe.views import Observer
from display.panels.panel import SpikePanel


def row_timing_effect(panel: SpikePanel, observer: Observer) -> Effect:
    """Without this effect, all rows are shown with the first one. The weights of the last row
    change as for light `row_delay` later, and for a moving eye the position changes by its speed
    times this delay. The weights of neighbouring planes change in the same way, so moving light
    counts over the whole response."""

    def bound(scene: Summary) -> Bound:
        change = delay_change(observer, panel, scene.cycles, round(panel.row_delay))
        return promise(scene, panel, observer, change, float("inf"))

    source = "rows that a matrix drives one after another (SpikePanel.row_scan)"
    return Effect("row timing", source, Stream.NONE, bound, lambda scene: ROWS)
