"""The [sensor] section of a recorded stream that takes the place of a chip."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cosim.config.quantity import Duration, Frequency, Section, Time
from cosim.files.plane_order import BitOrder, ByteOrder, Flip, PlaneOrder
from sensor.sections.unlatched import Side

LATENCY = 0.1
"""Default of source_latency, s: up to it, a response seems immediate (Card, Robertson and
Mackinlay, CHI 1991)."""


class RecordedSection(Section):
    """A recorded stream, and what its format does not say."""

    source: str = Field(
        examples=["file:recording.dat"],
        description="file:PATH, a stream (.dat, .raw, .npz, .zarr, .events.npz, .fsc) or the "
        "folder of a run; pipe:PATH, a named pipe, or pipe:-, standard input, with planes as in a "
        ".dat",
    )
    source_timeout: Duration | None = Field(
        default=None,
        description="follows a .dat that grows, until it has not grown for this time or has "
        "duration; a pipe ends when nothing has come for this time; by default a file is read as "
        "it is, and a pipe until its writer closes it",
    )
    source_latency: Time = Field(
        default=LATENCY,
        description="latency of the source of a live stream: a plane is late if its "
        "processing begins later than its time, by sensor.clock from the first plane on, plus this",
    )
    bit_order: BitOrder = Field(
        default="little",
        description="order of bits of a .dat or pipe: the first pixel of a byte is its least "
        "(little) or most significant bit",
    )  # fmt: skip
    byte_order: ByteOrder = Field(
        default="little",
        description="order of bytes of a .dat or pipe: bytes as they stand (little), or words of "
        "that many bits with the most significant byte first",
    )  # fmt: skip
    flip: Flip = Field(
        default="vertical",
        description="flip of a .dat or pipe: how its pictures are turned over to be upright; "
        "vertical for rows from the bottom up",
    )  # fmt: skip
    clock: Frequency | None = Field(
        default=None,
        description="clock of the cycles, for a .dat or .raw, which do not keep it, and for "
        "events, which are latched by it; by default that of the format or file",
    )
    width: Side | None = Field(
        default=None, description="pixels as stored, for a .dat or pipe; by default of its "
        "config.yaml or length, 400 if it comes without one",
    )  # fmt: skip
    height: Side | None = Field(default=None, description="pixels, given with width")
    white_rate: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="spikes a cycle of white; by default that of the run's result.json, else the "
        "rate that 99 % of the pixels do not exceed",
    )

    @property
    def order(self) -> PlaneOrder:
        """The order of bits, bytes and rows of planes without a header."""
        return PlaneOrder(self.bit_order, self.byte_order, self.flip)
