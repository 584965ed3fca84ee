"""Chips without a latch clock: [sensor.asynchronous], [sensor.channel] and [sensor.continuous]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Duration, Frequency, Quantity, Section, Time

Side = Annotated[int, Field(ge=1, le=65535)]
TimeConstant = Annotated[float, Quantity("time", above=0, most=1)]
Threshold = Annotated[float, Quantity("current", above=0, most=1e12)]


class AsynchronousSection(Section):
    """How asynchronous pixels fire and what they send."""

    shortest_width: Duration = Field(
        default=1e-8,
        examples=["10 ns"],
        description="least width the circuit reads out; a pixel full sooner waits",
    )
    longest_width: Duration | None = Field(
        default=None,
        examples=["10 ms"],
        description="time after which the charge is read without a spike; never when absent",
    )
    levels: Annotated[int, Field(ge=1, le=65535)] = Field(
        default=1, description="N of that reading, floor(N charge / threshold)"
    )
    timing: Frequency = Field(
        default=1e9,
        examples=["1 GHz"],
        description="clock that measures times and widths; whole picoseconds a period",
    )
    change: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=0.0,
        description="relative standard deviations by which a width must leave the last one sent to "
        "be sent; 0 sends every spike",
    )
    width: Side | None = Field(default=None, description="pixels; the chip's own when absent")
    height: Side | None = Field(default=None, description="pixels; the chip's own when absent")
    most_events: Annotated[int, Field(ge=1, le=10**9)] = Field(
        default=20_000_000, description="a run with more ends; about 110 bytes of memory each"
    )


class ChannelSection(Section):
    """The asynchronous output that all pixels share."""

    rate: Frequency = Field(examples=["100 MHz"], description="events a second")
    arbitration: Literal["fifo", "priority", "round-robin"] = Field(
        default="round-robin", description="who goes next: the oldest, the top row, the next row"
    )
    buffer: Literal["pixel", "row", "fifo"] = Field(
        default="pixel", description="place where an event waits: one a pixel, one a row, one queue"
    )
    depth: Annotated[int, Field(ge=0, le=10**8)] = Field(
        default=16, description="events in the queue of buffer = fifo"
    )
    timestamp: Literal["pixel", "channel"] = Field(
        default="pixel",
        description="place where t is taken: at the pixel, or as it leaves the channel; what "
        "leaves it after the run's end is then left out",
    )


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
