"""[sensor.asynchronous] and [sensor.channel]: a chip whose pixels fire when they are full."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Duration, Frequency, Section

Side = Annotated[int, Field(ge=1, le=65535)]


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
