"""The [imager] section of the adaptive-exposure sensor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Quantity, Section, Temperature
from imagers.common.kind import Device, First, ImagerSection, Side, Writes


class CouplingSection(Section):
    """Switching logic that couples onto the sampled pixels. The document prints no size of it."""

    charge: Annotated[float, Quantity("charge", least=0, most=1e5)] = Field(
        default=0.0, examples=["20 e"],
        description="charge that one toggle of a counter's bit couples onto a pixel; assumed",
    )  # fmt: skip
    time_constant: Annotated[float, Quantity("time", above=0, most=1e-4)] = Field(
        default=200e-9, examples=["200 ns"], description="time constant of its decay; assumed"
    )
    code: Literal["gray", "binary"] = Field(default="gray", description="code of the counters")
    idle: bool = Field(
        default=True, description="false: counters run in the half of the work cycle that ends "
        "with the sample, not in the half before",
    )  # fmt: skip


class AdaptiveSection(ImagerSection):
    """The adaptive-exposure CMOS sensor: rolling shutter, 8 bits, one exposure per frame."""

    kind: Literal["adaptive-exposure"]
    rows: Annotated[int, Field(ge=2, le=2048, multiple_of=2)] = Field(
        default=256, description="even; the document does not print it"
    )
    columns: Annotated[int, Field(ge=2, le=2048, multiple_of=2)] = Field(
        default=256, description="even; the document does not print it"
    )
    frame_rate: Annotated[float, Quantity("frequency", least=0.05, most=10_000)] = Field(
        default=100.0, examples=["100 Hz"]
    )
    adapt: bool = Field(default=True, description="false: the exposure stays as it is written")
    search: Literal["256th", "root", "half"] = Field(
        default="root", description="what a saturated frame makes of the exposure: a 256th, the "
        "square root of its multiple, a half",
    )  # fmt: skip
    multiplier: Annotated[int, Field(ge=1, le=2**24)] = Field(
        default=1, description="exposure while adapt is false, in units of 1 us"
    )
    longest: Annotated[int, Field(ge=0, le=24)] = Field(
        default=16, description="n of the longest exposure that is chosen, 2^n us"
    )
    window: tuple[First, First, Side, Side] | None = Field(
        default=None, description="first row, first column, rows and columns in which saturated "
        "pixels are counted; all when absent",
    )  # fmt: skip
    threshold: Annotated[int, Field(ge=0, lt=2**24)] | None = Field(
        default=None, description="saturated pixels that are still allowed; one in 1024 when absent"
    )
    gain: Annotated[float, Field(gt=0, le=64)] = Field(
        default=1.0, description="gain before the ADC"
    )
    temperature: Temperature = 27.0
    device_seed: Device = 1
    coupling: CouplingSection | None = None
    writes: Writes = ()
