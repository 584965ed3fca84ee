"""Effects that the simulation of a display may leave out: emission, whose light follows its drive
with time constants; row timing, by which rows are shown one after another; and the timing of spikes
within spans of planes that are shown as one.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import (
    EMISSION,
    JUMP,
    ROWS,
    SPAN_COST,
    dark_rate,
    fluctuation,
    promise,
    spread,
    total_variation,
)
from display.effects.weights import delay_change, span_change, steps
from display.observe.views import Observer
from display.panels.panel import SpikePanel

SPANS: Final = (1, 8, 64)
"""Numbers of planes in a span, from the full resolution to the planes of a draw call."""


def emission_effect(panel: SpikePanel, observer: Observer) -> Effect:
    """Without this effect, light follows its drive without delay.

    The level y follows y' = (x - y) / rise upwards and (x - y) / decay downwards. The light of a
    plane is that of the drive, less rise times the increase of y, plus decay times its decrease.
    Let t = (rise + decay) / 2, in planes: this is less t (y(n+1) - y(n)), plus (decay - rise) / 2
    times the total variation of y. Summed by parts, the first term is t times the steps of the
    weights applied to y. The second term is additional light of an emitter with unequal time
    constants, in proportion to the variation. A packet changes y by at most (1 - e^(-pulse / rise))
    / pulse.
    """
    hz = panel.clock.hz
    mean, apart = (panel.rise + panel.decay) / 2 * hz, abs(panel.decay - panel.rise) / 2 * hz
    pulse = panel.pulse
    swing = (1.0 if panel.rise == 0 else -math.expm1(-pulse / (panel.rise * hz))) / pulse

    def bound(scene: Summary) -> Bound:
        change = steps(observer, panel, scene.cycles)
        moving = np.asarray(scene.planes) > 0
        # The level of a hold is constant for several planes.
        likely = change.root * fluctuation(scene, panel.scheme, np.inf)
        likely = likely * (swing if panel.packets else 1.0)
        if not panel.packets:  # dark before the first or second spike
            likely = likely + change.jump * dark_rate(scene, change.unseen, panel.scheme.spikes)[0]
        likely = (
            likely
            + change.lost * (1 + spread(scene))
            + JUMP * 2 * change.half * spread(scene) * moving
        )
        # With few packets, their number varies between pixels, and the additional light with it.
        grain = change.grain * fluctuation(scene, panel.scheme, np.inf)
        value = mean * likely + apart * total_variation(scene, panel.scheme, swing) * np.hypot(
            1, grain
        )
        if panel.rise > panel.decay:  # relative to the remaining light
            value = np.where(value < 1, value / np.maximum(1 - value, 1e-12), np.inf)
        return Bound(value, "estimate")

    source = "first-order emitter (SpikePanel.rise, decay), its light integrated by parts"
    return Effect("emission rise and decay", source, Stream.NONE, bound, lambda scene: EMISSION)


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
