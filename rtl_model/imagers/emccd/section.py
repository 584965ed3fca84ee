"""The [imager] section of the EMCCD."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cosim.config.quantity import Quantity, Temperature, Time
from rtl_model.imagers.interface.section import Device, ImagerSection, Writes

__all__ = ["EmccdSection"]


class EmccdSection(ImagerSection):
    """The frame-transfer EMCCD: exposure between two transfers, gain in 256 steps, window, sync."""

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
    def _check(self) -> EmccdSection:
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
