"""Row-by-row sampling and comparator delay: both move the sampling instant (see ../sampling.py)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from cosim.clock import PS, Clock
from cosim.config.amounts import at_most
from cosim.config.quantity import Share, Time
from cosim.errors import InputError
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import (
    USUAL,
    Key,
    Operation,
    PixelEffect,
    Setting,
    Sized,
    sampling_cost,
)
from sensor.latched.effects.windows import bound_of, shift_error
from sensor.latched.sampling import row_delays


def check_within_cycle(key: str, seconds: float, clock: Clock) -> None:
    """Raises InputError for a time longer than a cycle. key: key of [sensor], for the message."""
    if seconds > float(clock.period):
        raise InputError(
            f"sensor.{key}", f"at most a cycle, {at_most(float(clock.period))} s", f"{seconds:g} s",
            "shorten it",
        )  # fmt: skip


def _moved(cycles: float, scene: Summary) -> Bound:
    """Bound of a window that is moved by a share of a cycle. It gains light at one end and loses
    light at the other: at most the range of the light for that time, and none under constant light.
    """
    span = (scene.brightest - scene.darkest) * cycles * (np.asarray(scene.planes) > 0)
    moved = shift_error(scene, span / scene.threshold)
    return bound_of(scene, scene.relative(span / scene.window) + moved, True)


class _RowSampling(PixelEffect):
    name = "row-by-row sampling"
    source = "row selectors of EP4340384 and US12581222B2; whether SpikeTwo has them is not known"
    group = "sampling"
    reach = (0, 1)
    parameters: ClassVar = {"row_skew": 0.0}
    keys: ClassVar = {
        "row_skew": Key(
            Share,
            Field(
                default=0.0,
                description="share of a cycle in which the rows are sampled one after another",
            ),
            silicon=Sized(
                1.0, "assumed", "EP4340384: rows are sampled one after another in the cycle"
            ),
        )
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        return {"row_skew": section.skew}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        return _moved(setting.row_skew, scene)

    def cost(self, scene: Summary) -> Any:
        return sampling_cost(scene)

    def sampling(self, setting: Setting) -> npt.NDArray[np.float64]:
        return row_delays(setting.clock, setting.chip.height, setting.row_skew)


class _ComparatorDelay(PixelEffect):
    name = "comparator delay"
    source = "a latch that samples a delayed comparator: an offset of the sampling instant"
    group = "sampling"
    reach = (1, 0)
    parameters: ClassVar = {"comparator_delay": 0.0}
    keys: ClassVar = {
        "comparator_delay": Key(
            Time,
            Field(
                default=0.0,
                examples=["1 us"],
                description="delay from full to fired; at most a cycle",
            ),
            pixels=("latched", "asynchronous"),
            silicon=Sized(20e-9, "assumed", USUAL),
            first=True,
        )
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        check_within_cycle("comparator_delay", section.comparator_delay, operation.clock)
        return {"comparator_delay": section.comparator_delay}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        return _moved(setting.comparator_delay * setting.clock.hz, scene)

    def cost(self, scene: Summary) -> Any:
        return sampling_cost(scene)

    def sampling(self, setting: Setting) -> float:
        return float(-setting.comparator_delay * PS)


ROW_SAMPLING, COMPARATOR_DELAY = _RowSampling(), _ComparatorDelay()
