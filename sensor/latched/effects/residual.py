"""Residual carried: charge beyond the threshold of a spike counts in the next interval."""

from __future__ import annotations

import numpy as np

from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting


class _Residual(PixelEffect):
    name = "residual carried"
    source = "Huang 2022 section 3.2; interval variances of a public recording fit this rule alone"
    inherent = True  # a rule of the pixel model, without a hook

    def acts(self, setting: Setting) -> bool:
        return self in setting.effects and setting.reset == "residual"

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # A reset to zero loses up to one cycle's light at each spike: the share (light of a cycle)
        # / (light of an interval) of the rate, and at most all of it.
        return Bound(np.minimum(1.0, scene.brightest / scene.threshold), "proof")


RESIDUAL = _Residual()
