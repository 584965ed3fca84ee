"""Timing noise of the pixels in a band of rows (see ../sampling.py)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final

from pydantic import Field

from cosim.compute.streams import Stream
from cosim.config.quantity import Share
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import Key, Operation, PixelEffect, Setting, Sized, sampling_cost
from sensor.latched.effects.windows import bound_of, shift_error
from sensor.latched.sampling import MOST_JITTER, RowTiming

_RECORDING: Final = "a recording of a 400 x 250 chip, 500 cycles of a static board"


class _RowTiming(PixelEffect):
    name = "row timing noise"
    source = "a recording of a 400 x 250 chip: excess variance of intervals in a band of rows"
    stream = Stream.ROW_TIMING
    group = "sampling"
    reach = (1, 1)
    parameters: ClassVar = {"row_timing": None}
    keys: ClassVar = {
        "row_jitter": Key(
            Annotated[float, Field(ge=0, le=MOST_JITTER)],
            Field(
                default=0.0,
                description="timing noise, RMS, of the pixels in the middle of a band of rows, "
                "cycles; independent from pixel to pixel and from cycle to cycle",
            ),
            silicon=Sized(0.084, "assumed", f"{_RECORDING}: excess variance 0.014 cycles^2, 2 s^2"),
        ),
        "row_wander": Key(
            Annotated[float, Field(ge=0, le=0.01)],
            Field(
                default=0.0,
                description="change of an interval there, RMS, by slow movement of the instants of "
                "each pixel, relative",
            ),
            silicon=Sized(0.008, "assumed", f"{_RECORDING}: 0.8 % an interval"),
        ),
        "row_band": Key(
            Share,
            Field(default=0.5, description="middle of that band as a share of the height"),
        ),
        "row_band_width": Key(
            Annotated[float, Field(ge=1, le=1000)],
            Field(
                default=35.0,
                description="full width of that band at half maximum, rows; of the recording",
            ),
        ),
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        if not section.row_jitter and not section.row_wander:
            return {"row_timing": None}
        return {
            "row_timing": RowTiming(
                section.row_jitter, section.row_wander, section.row_band, section.row_band_width
            )
        }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # Each end of a window gains or loses the light of a move; spikes move against their draws.
        light = 2**0.5 * scene.timing * scene.brightest
        moved = shift_error(scene, scene.timing * scene.brightest / scene.threshold)
        return bound_of(scene, scene.relative(light / scene.window) + moved, False, held=False)

    def cost(self, scene: Summary) -> Any:
        return sampling_cost(scene)


ROW_TIMING = _RowTiming()
