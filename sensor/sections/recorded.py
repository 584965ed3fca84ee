"""The [sensor] section of a recorded stream that takes the place of a chip."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cosim.config.quantity import Frequency, Section
from sensor.sections.asynchronous import Side

__all__ = ["RecordedSection"]


class RecordedSection(Section):
    """A recorded stream, and what its format does not say."""

    source: str = Field(
        examples=["file:recording.dat"],
        description="file:PATH, a stream (.dat, .raw, .npz, .zarr, .events.npz, .fsc) or the "
        "folder of a run",
    )
    clock: Frequency | None = Field(
        default=None,
        description="of the cycles, for a .dat or .raw, which do not keep it, and for events, "
        "which are latched by it; by default that of the format or file",
    )
    width: Side | None = Field(
        default=None, description="pixels as stored, for a .dat; by default of its config.yaml or "
        "length",
    )  # fmt: skip
    height: Side | None = Field(default=None, description="pixels, given with width")
    white_rate: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="spikes a cycle of white; by default that of the run's result.json, else the "
        "rate that 99 % of the pixels do not exceed",
    )
