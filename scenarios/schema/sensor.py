"""The [sensor] section: the chip, how it is run, its lens and its device."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from scenarios.schema.asynchronous import AsynchronousSection, ChannelSection
from scenarios.schema.quantity import (
    Charge,
    Current,
    Frequency,
    Noise,
    Section,
    Share,
    Spread,
    Temperature,
    Time,
    Wavelength,
)
from sensor import CHIPS

__all__ = ["LensSection", "PatternSection", "SensorSection"]


class LensSection(Section):
    """The lens in front of the chip."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)] | None = Field(
        default=None, description="chosen so that white fires at white_rate when absent"
    )
    white_rate: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.6, description="spikes a cycle of white, for a chosen f-number"
    )
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0
    psf: Literal["none", "airy"] = "none"


class PatternSection(Section):
    """What differs from pixel to pixel of one device and stays. Nothing of it is published for the
    chips here: every size is the user's own."""

    device_seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    prnu: Spread = Field(default=0.0, description="spread of the light's gain, relative")
    threshold_fpn: Spread = Field(default=0.0, description="spread of the threshold, relative")
    dark_current: Current = Field(default=0.0, description="mean, at 25 degC")
    dsnu: Spread = Field(default=0.0, description="spread of the dark current, relative to it")
    temperature: Temperature = Field(default=25.0, description="dark current doubles every 6.5 K")
    hot_pixels: Share = Field(default=0.0, description="share of pixels")
    hot_current: Current = Field(default=0.0, description="that a hot pixel has on top")
    dead_pixels: Share = Field(default=0.0, description="share of pixels that see no light")


class SensorSection(Section):
    """The chip and how it is run."""

    chip: Literal[tuple(CHIPS)] = "spiketwo"  # type: ignore[valid-type]  # the presets' names
    readout: Literal["synchronous", "asynchronous"] = Field(
        default="synchronous", description="latched by the clock, or each pixel when it is full"
    )
    clock: Frequency = 40e3
    threshold: Charge
    wavelength: Wavelength = Field(default=555.0, description="at which lux are counted as photons")
    reset: Literal["residual", "hard", "subtract"] = Field(
        default="residual", description="what becomes of charge beyond the threshold at a spike"
    )
    threshold_noise: Noise = Field(default=0.0, description="standard deviation, of each spike")
    dead_time: Time = Field(default=0.0, description="after each spike; at most a cycle")
    lens: LensSection = LensSection()
    pattern: PatternSection | None = None
    asynchronous: AsynchronousSection | None = None
    channel: ChannelSection | None = Field(
        default=None, description="output that asynchronous pixels share; none when absent"
    )
