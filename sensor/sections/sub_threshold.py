"""[sensor.sub_threshold] and sensor.dark_limit: dim light (Huang 2022, 4.4 and 4.5)."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from cosim.config.quantity import DAY, Duration, Quantity, Section

_DARK: Final = "dark current"


class _DarkLimit(Quantity):
    """A duration, or the text "dark current", which is read as 0."""

    def read(self, value: object) -> float:
        if value == _DARK:
            return 0.0
        try:
            return super().read(value)
        except ValueError as exc:
            raise ValueError(f"{exc}, or '{_DARK}'") from None

    def write(self, value: float) -> str:
        return super().write(value) if value else _DARK


DarkLimit = Annotated[float, _DarkLimit("time", above=0, most=DAY)]
"""Seconds; 0 stands for Q over the device's dark current."""


class SubThresholdSection(Section):
    """Reading of the charge of pixels that have not fired for some time."""

    limit: Duration = Field(
        examples=["10 ms"],
        description="time between two readings: a pixel that has not fired in it is read",
    )
    levels: Annotated[int, Field(ge=1, le=65535)] = Field(
        default=100, description="N of a reading, floor(N charge / threshold)"
    )
