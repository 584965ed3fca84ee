"""The [sensor.continuous] section: a sensor that reports absolute intensities when they change."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cosim.config.quantity import Quantity, Section, Time
from sensor.sections.asynchronous import Side

TimeConstant = Annotated[float, Quantity("time", above=0, most=1)]
Threshold = Annotated[float, Quantity("current", above=0, most=1e12)]


class ContinuousSection(Section):
    """Continuous photographing, Huang 2022 section 3.1. The source gives the principle and no
    number but the sun's: every other default is assumed."""

    time_constant: TimeConstant = Field(
        default=250e-6,
        examples=["250 us"],
        description="time constant of the filter through which the photocurrent is watched",
    )
    contrast: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.1, description="change that is reported, relative to the last report"
    )
    floor: Threshold | None = Field(
        default=None,
        examples=["1000 e/s"],
        description="least change that is reported; when absent, what makes the threshold 6 "
        "standard deviations of shot noise or more at any light",
    )
    measure: Time = Field(
        default=0.0,
        examples=["100 us"],
        description="averages the photocurrent for so long; 0 reads the filter",
    )
    dead_time: Time = Field(
        default=0.0, examples=["10 us"], description="dead time after each report"
    )
    bits: Annotated[int, Field(ge=1, le=24)] = Field(
        default=14, description="bits of a report's value"
    )
    exponent_bits: Annotated[int, Field(ge=0, le=6)] = Field(
        default=5,
        description="bits of the exponent in a report's value; 0 makes a linear converter",
    )
    # 4.09e10 photons a second at 1e5 lux and QE 0.7 are 2.9e10 (Huang 2022 section 4.3).
    full_scale: Threshold = Field(
        default=3e10, examples=["3e10 e/s"], description="largest value of the converter"
    )
    shot_noise: bool = True
    width: Side | None = Field(default=None, description="pixels; the chip's own when absent")
    height: Side | None = Field(default=None, description="pixels; the chip's own when absent")
    most_reports: Annotated[int, Field(ge=1, le=10**9)] = Field(
        default=20_000_000, description="a run with more ends; some 100 bytes of memory each"
    )
