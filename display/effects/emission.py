"""Emission: light that rises and decays towards its drive with time constants."""

from __future__ import annotations

import math

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from display.effects.bounds import JUMP
from display.effects.costs import EMISSION
from display.effects.statistics import flutter, spread, unlit_rate, unsteady
from display.effects.weights import steps
from display.observe.views import Observer
from display.panels.panel import SpikePanel

__all__ = ["emission_effect"]


def emission_effect(panel: SpikePanel, observer: Observer) -> Effect:
    """Left out, light follows its drive at once.

    With y' = (x - y) / rise upwards and / decay downwards, a plane's light is the drive's less
    rise times what y went up in it, plus decay times what it went down: with t = (rise + decay) / 2
    in planes, less t (y(n+1) - y(n)), plus (decay - rise) / 2 of its way up and down. Summed by
    parts the first is t times the steps of the weights over y; the second is light that an emitter
    of unequal constants makes of its own, in proportion to how unsteady it is. A packet swings y by
    (1 - e^(-pulse / rise)) / pulse at most, in a plane's packets.
    """
    hz = panel.clock.hz
    mean, apart = (panel.rise + panel.decay) / 2 * hz, abs(panel.decay - panel.rise) / 2 * hz
    pulse = panel.pulse
    swing = (1.0 if panel.rise == 0 else -math.expm1(-pulse / (panel.rise * hz))) / pulse

    def bound(scene: Summary) -> Bound:
        change = steps(observer, panel, scene.cycles)
        moving = np.asarray(scene.planes) > 0
        # A hold goes on for planes, and its levels with it.
        likely = change.root * flutter(scene, panel.scheme, np.inf)
        likely = likely * (swing if panel.packets else 1.0)
        if not panel.packets:  # dark up to the first or second spike
            likely = likely + change.jump * unlit_rate(scene, change.unseen, panel.scheme.spikes)[0]
        likely = (
            likely
            + change.lost * (1 + spread(scene))
            + JUMP * 2 * change.half * spread(scene) * moving
        )
        # Of few packets some pixels have more: what each makes of its own varies as their number.
        grain = change.grain * flutter(scene, panel.scheme, np.inf)
        value = mean * likely + apart * unsteady(scene, panel.scheme, swing) * np.hypot(1, grain)
        if panel.rise > panel.decay:  # of the light that is left
            value = np.where(value < 1, value / np.maximum(1 - value, 1e-12), np.inf)
        return Bound(value, "estimate")

    source = "first-order emitter (SpikePanel.rise, decay), its light integrated by parts"
    return Effect("emission rise and decay", source, Stream.NONE, bound, lambda scene: EMISSION)
