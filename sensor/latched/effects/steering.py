"""Ticks whose lengths a control loop sets (see ../sampling.py)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting


class _ClockSteering(PixelEffect):
    name = "clock steering"
    source = "the counter of the board that makes the ticks (sensor/device/chips.py)"
    group = "sampling"
    reach = (1, 1)
    parameters: ClassVar = {"clock_moves": None}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The receiver's clock is no effect to leave out: other edges would be another run.
        return Bound(np.inf, "proof")


CLOCK_STEERING = _ClockSteering()
