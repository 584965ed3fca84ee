"""The [sensor] section: the chip, how it is run, its lens and its device."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from cosim import InputError
from cosim.config.quantity import (
    Capacitance,
    Charge,
    Current,
    Frequency,
    Noise,
    Quantity,
    Section,
    Share,
    Spread,
    Temperature,
    Time,
    Wavelength,
)
from sensor import CHIPS, SILICON
from sensor.sections.asynchronous import AsynchronousSection, ChannelSection
from sensor.sections.circuit import CircuitSection
from sensor.sections.continuous import ContinuousSection

__all__ = ["SPIKING", "LensSection", "PatternSection", "SensorSection"]

SPIKING = ("row_skew", "comparator_delay", "dead_time", "threshold_noise", "threshold_fpn")
"""Faults that only a pixel which spikes has."""
ABSENT: dict[Any, tuple[str, ...]] = {
    "asynchronous": ("row_skew", "threshold_noise"),
    "continuous": SPIKING,
}
"""Faults of the preset that pixels of a readout do not have."""
LEVELS = 16
"""Threshold settings from outside (Huang 2022 section 6), on either chip."""


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
    chips here: a size is the user's own, or assumed by the preset `silicon`."""

    device_seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    prnu: Spread = Field(default=0.0, description="spread of the light's gain, relative")
    threshold_fpn: Spread = Field(default=0.0, description="spread of the threshold, relative")
    dark_current: Current = Field(default=0.0, examples=["100 e/s"], description="mean, at 25 degC")
    dsnu: Spread = Field(default=0.0, description="spread of the dark current, relative to it")
    temperature: Temperature = Field(default=25.0, description="dark current doubles every 6.5 K")
    hot_pixels: Share = Field(default=0.0, description="share of pixels")
    hot_current: Current = Field(
        default=0.0, examples=["100000 e/s"], description="that a hot pixel has on top"
    )
    dead_pixels: Share = Field(default=0.0, description="share of pixels that see no light")

    @model_validator(mode="after")
    def _do_something(self) -> PatternSection:
        """A key that would change nothing, because what it needs is absent, is a mistake."""
        for name, needs, why, example in _NEEDS:
            if getattr(self, name) > 0 and getattr(self, needs) == 0:
                raise InputError(
                    f"sensor.pattern.{needs}",
                    f"above 0 with {name} = {getattr(self, name):g}, which {why}", "0 e/s",
                    f"write --set sensor.pattern.{needs}='{example}', or leave {name} out",
                )  # fmt: skip
        return self


_NEEDS = (
    ("dsnu", "dark_current", "is a share of it", "100 e/s"),
    ("hot_pixels", "hot_current", "are those that have it", "100000 e/s"),
)
"""Keys of [sensor.pattern], the current without which each does nothing, why, and a current."""


class SensorSection(Section):
    """The chip and how it is run."""

    chip: Literal[tuple(CHIPS)] = "spiketwo"  # type: ignore[valid-type]  # the presets' names
    preset: Literal["ideal", "silicon"] = Field(
        default="ideal", description="silicon: every fault absent here gets the size assumed for it"
    )
    source: str | None = Field(
        default=None,
        description="serial:PORT or serial:PORT,BAUD: a board makes the spikes, PORT a device, a "
        "URL of pyserial or virtual; simulated when absent",
    )
    readout: Literal["synchronous", "asynchronous", "continuous"] = Field(
        default="synchronous",
        description="spikes latched by the clock, spikes as pixels are full, or absolute "
        "intensities as they change",
    )
    clock: Frequency = 40e3
    threshold: Charge
    threshold_level: Annotated[int, Field(ge=1, le=LEVELS)] = Field(
        default=LEVELS, description=f"the chip's setting: level n fires at n/{LEVELS} of threshold"
    )
    wavelength: Wavelength = Field(default=555.0, description="at which lux are counted as photons")
    reset: Literal["residual", "hard", "subtract"] = Field(
        default="residual", description="what becomes of charge beyond the threshold at a spike"
    )
    threshold_noise: Noise = Field(
        default=0.0, examples=["5 e"], description="standard deviation, of each spike"
    )
    capacitance: Capacitance | None = Field(
        default=None, description="its kTC noise is added to the threshold noise"
    )
    dead_time: Time = Field(
        default=0.0, examples=["1 us"], description="after each spike; at most a cycle"
    )
    comparator_delay: Time = Field(
        default=0.0, examples=["1 us"], description="from full to fired; at most a cycle"
    )
    row_skew: Share = Field(
        default=0.0, description="share of a cycle in which the rows are sampled one after another"
    )
    crosstalk: Annotated[float, Field(ge=0, le=0.5)] = Field(
        default=0.0, description="share of its light that a pixel loses to its neighbours"
    )
    lens: LensSection = LensSection()
    pattern: PatternSection | None = None
    circuit: CircuitSection | None = Field(
        default=None, description="capacitance, leak, comparator and reset of a synchronous pixel"
    )
    asynchronous: AsynchronousSection | None = None
    continuous: ContinuousSection | None = None
    channel: ChannelSection | None = Field(
        default=None, description="output that asynchronous pixels share; none when absent"
    )

    @model_validator(mode="before")
    @classmethod
    def _silicon(cls, data: Any) -> Any:
        """Fills in what the preset says of keys that are absent."""
        if not isinstance(data, dict) or data.get("preset") != "silicon":
            return data
        fields = cls.model_fields | PatternSection.model_fields
        sizes: dict[str, Any] = {}
        for name, sized in SILICON.rows():
            unit = next((m for m in fields[name].metadata if isinstance(m, Quantity)), None)
            sizes[name] = sized.value if unit is None else unit.write(sized.value)
        try:  # the preset's noise is a share of the threshold; a wrong one is refused on its own
            charge = Quantity("charge").read(data.get("threshold"))
            charge *= int(data.get("threshold_level", LEVELS)) / LEVELS
            noise = SILICON.threshold_noise.value * charge
            sizes["threshold_noise"] = Quantity("charge").write(noise)
        except (ValueError, TypeError):
            del sizes["threshold_noise"]
        sizes = {
            n: v for n, v in sizes.items() if n not in ABSENT.get(str(data.get("readout")), ())
        }
        if data.get("circuit") is not None:  # whose reset takes its own time
            sizes.pop("dead_time", None)
        pattern = data.get("pattern", {})
        if isinstance(pattern, dict):
            for name, needs, *_ in _NEEDS:
                if _is_none(pattern.get(needs)):  # taken out of the preset, so that it has no share
                    sizes.pop(name, None)
            pattern = {n: v for n, v in sizes.items() if n in PatternSection.model_fields} | pattern
        own = {n: v for n, v in sizes.items() if n in cls.model_fields}
        return own | data | {"pattern": pattern}


def _is_none(value: Any) -> bool:
    """Whether a current is given as 0; a wrong one is refused on its own."""
    try:
        return value is not None and Quantity("current").read(value) == 0
    except ValueError:
        return False
