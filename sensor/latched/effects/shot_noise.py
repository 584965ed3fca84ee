"""Shot noise of light: the threshold of each spike is drawn from Gamma(Q) (pixel/interval.py)."""

from __future__ import annotations

import math
from typing import Any

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting, noise_cost
from sensor.latched.effects.windows import bound_of, lost_spikes, noise_error


class _ShotNoise(PixelEffect):
    name = "shot noise"
    source = "Huang 2022 section 5.1: intervals are Gamma(Q, rate)"
    inherent = True
    stream = Stream.SHOT_NOISE
    scope = "tile"
    group = "noise"

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The rate of a window has the noise of its intervals, 1/sqrt(Q) each, in total
        # 1/sqrt(electrons). With noise, two spikes may fall in one cycle, which the latch counts as
        # one.
        value = noise_error(scene, 1 / math.sqrt(scene.threshold))
        return bound_of(scene, value + scene.relative(lost_spikes(scene) * scene.threshold), False)

    def cost(self, scene: Summary) -> Any:
        return noise_cost(scene)


SHOT_NOISE = _ShotNoise()
