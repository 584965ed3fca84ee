"""Dead time: comparator delay and reset after each spike, during which light is lost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from cosim.config.quantity import Time
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import (
    Key,
    Operation,
    PixelEffect,
    Setting,
    Sized,
    dead_time_cost,
)
from sensor.latched.effects.sampling import check_within_cycle
from sensor.latched.effects.windows import bound_of, shift_error


class _DeadTime(PixelEffect):
    name = "reset dead time"
    source = (
        "non-paralysable dead time (Knoll, Radiation Detection and Measurement, 4th ed., ch. 4)"
    )
    scope = "tile"
    parameters: ClassVar = {"dead_time": 0.0}
    keys: ClassVar = {
        "dead_time": Key(
            Time,
            Field(
                default=0.0,
                examples=["1 us"],
                description="dead time after each spike; at most a cycle",
            ),
            pixels=("latched", "asynchronous"),
            silicon=Sized(50e-9, "assumed", "SCSim's reset delay, 0.2 % of a 25 us cycle"),
            first=True,
        )
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        check_within_cycle("dead_time", section.dead_time, operation.clock)
        return {"dead_time": section.dead_time}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The rate is 1 / (Q / light + dead time). Without dead time it is higher by at most the
        # share light x dead time / Q; a window counts whole spikes.
        cycles = setting.dead_time * setting.clock.hz
        spikes = scene.brightest / scene.threshold
        # A window of n intervals on average may contain one spike more. Over a tile the mean of r^4
        # is at most max(r)^3 mean(r), so the RMS of r^2 relative to the mean is at most
        # max(r)^1.5 / sqrt(mean(r)).
        uneven = np.sqrt(scene.relative(scene.brightest))
        gained = (spikes + 1 / scene.window) * cycles * uneven
        moved = shift_error(scene, spikes * spikes * cycles * scene.cycles)
        return bound_of(scene, gained + moved, True)

    def cost(self, scene: Summary) -> Any:
        return dead_time_cost(scene)

    def dead_time(self, setting: Setting) -> float:
        return float(setting.dead_time)


DEAD_TIME = _DeadTime()
