"""Row timing: rows are shown one after another."""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import promise
from display.effects.costs import ROWS
from display.effects.weights import delay_change
from display.observe.views import Observer
from display.panels.panel import SpikePanel

__all__ = ["row_timing_effect"]


def row_timing_effect(panel: SpikePanel, observer: Observer) -> Effect:
    """Left out, every row is shown with the first: weights are those of light up to `row_delay`
    later, in the last row, and a moving eye is off by its speed times that. As the weights of
    neighbouring planes change alike, light that moves counts over the whole response at once."""

    def bound(scene: Summary) -> Bound:
        change = delay_change(observer, panel, scene.cycles, round(panel.row_delay))
        return promise(scene, panel, observer, change, float("inf"))

    source = "rows that a matrix drives one after another (SpikePanel.row_scan)"
    return Effect("row timing", source, Stream.NONE, bound, lambda scene: ROWS)
