"""Residual carried: what a spike leaves beyond its threshold starts the next interval."""

from __future__ import annotations

import numpy as np

from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting

__all__ = ["RESIDUAL"]


class _Residual(PixelEffect):
    name = "residual carried"
    source = "Huang 2022 section 3.2; interval variances of a public recording fit this rule alone"
    inherent = True  # the pixel's own rule: it has no hook

    def acts(self, setting: Setting) -> bool:
        return self in setting.effects and setting.reset == "residual"

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # A reset to zero forgets up to one cycle's light at each spike, a share of
        # (light of a cycle) / (light of an interval) of the rate, and never more than all of it.
        return Bound(np.minimum(1.0, scene.brightest / scene.threshold), "proof")


RESIDUAL = _Residual()
