"""The [imager] section of a scenario, in the place of the chip: one class a kind of imager."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cosim.config.quantity import Quantity, Section, Temperature, Time

__all__ = [
    "AdaptiveSection", "EbapsSection", "EmccdSection", "ImagerLens",
    "ImagerSection",
]  # fmt: skip

Side = Annotated[int, Field(ge=1, le=4096)]
First = Annotated[int, Field(ge=0, le=4095)]
Device = Annotated[int, Field(ge=0, lt=2**32)]
Writes = Annotated[
    tuple[tuple[Time, str, Annotated[int, Field(ge=0, lt=2**32)]], ...],
    Field(
        max_length=1000,
        description='register writes over the serial line: ["5 ms", "register", value], the value '
        "in the register's own unit",
        examples=[[["5 ms", "exposure", 100]]],
    ),
]
"""When the write has arrived, which register of the imager, and its value."""


class ImagerLens(Section):
    """The lens in front of an imager, which focuses points to points."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)]
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0


class AdaptiveSection(Section):
    """The adaptive-exposure CMOS sensor: rolling shutter, 8 bits, one exposure a frame."""

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
    gain: Annotated[float, Field(gt=0, le=64)] = Field(default=1.0, description="before the ADC")
    temperature: Temperature = 27.0
    device_seed: Device = 1
    writes: Writes = ()


class EbapsSection(Section):
    """The electron-bombarded APS: photocathode, high voltage, 16 bits, 30 frames/s."""

    kind: Literal["ebaps"]
    rows: Annotated[int, Field(ge=8, le=1024)] = 1024
    columns: Annotated[int, Field(ge=8, le=1280)] = 1280
    high_voltage: Annotated[float, Quantity("voltage", least=-1500, most=0)] = Field(
        default=-1500.0, examples=["-1500 V"]
    )
    exposure_loop: bool = Field(default=True, description="mean brightness sets the exposure")
    exposure: Annotated[float, Quantity("time", least=1e-3, most=32.768e-3)] = Field(
        default=16.384e-3, examples=["16 ms"], description="first one, or the one that stays"
    )
    darks: bool = Field(
        default=True, description="the mean of four dark frames at the live exposure is subtracted"
    )
    pedestal: Annotated[int, Field(ge=0, le=65535)] = Field(
        default=0, description="DN added to the difference, which is cut at 0"
    )
    temperature: Temperature = 27.0
    device_seed: Device = 1
    writes: Writes = ()


class EmccdSection(Section):
    """The frame-transfer EMCCD: two-transfer exposure, gain in 256 steps, window, sync."""

    kind: Literal["emccd"]
    exposure: Annotated[float, Quantity("time", least=1e-5, most=40.96e-3)] = Field(
        default=2e-3, examples=["2 ms"], description="whole steps of 10 us"
    )
    gain_step: Annotated[int, Field(ge=0, le=255)] | None = Field(
        default=None, description="of the digital potentiometer"
    )
    gain: Annotated[float, Field(ge=1, le=1000)] | None = Field(
        default=None, description="wanted: the nearest step is taken; 1 when neither is given"
    )
    first_row: Annotated[int, Field(ge=0, le=511)] = 0
    rows: Annotated[int, Field(ge=1, le=512)] = 512
    sync: Literal["internal", "external"] = "internal"
    pulses: tuple[Time, ...] = Field(
        default=(), max_length=100_000, description="instants of external sync"
    )
    pulse_rate: Annotated[float, Quantity("frequency", above=0, most=10_000)] | None = Field(
        default=None, examples=["50 Hz"],
        description="of external sync, the first at 0, in the place of pulses",
    )  # fmt: skip
    temperature: Temperature = Field(
        default=-10.0, examples=["-10 degC"], description="that the cooling loop holds"
    )
    ambient: Temperature = Field(default=25.0, description="of the camera's body")
    device_seed: Device = 1
    writes: Writes = ()

    @model_validator(mode="after")
    def _stands(self) -> EmccdSection:
        pulses = bool(self.pulses) + (self.pulse_rate is not None)
        for wrong, must in (
            (self.gain is not None and self.gain_step is not None, "with gain or gain_step alone"),
            (self.first_row + self.rows > 512, "with a window within its 512 rows"),
            (self.sync == "external" and not pulses, "with pulses or pulse_rate to wait for"),
            (pulses > 1, "with either pulses or pulse_rate"),
            (list(self.pulses) != sorted(self.pulses), "with pulses in order of time"),
        ):
            if wrong:
                raise ValueError(f"must be one {must}")
        return self


ImagerSection = Annotated[
    AdaptiveSection | EbapsSection | EmccdSection, Field(discriminator="kind")
]
