"""The [imager] sections of the pulse-modulated imagers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cosim import InputError
from cosim.config.amounts import amount
from cosim.config.quantity import Charge, Current, Noise, Quantity
from imagers.common.kind import ImagerSection


class PulseSection(ImagerSection):
    """A pixel of quantitative accumulation; all rows are exposed together, from a reset."""

    rows: Annotated[int, Field(ge=8, le=1024)] = 256
    columns: Annotated[int, Field(ge=8, le=1024)] = 256
    threshold: Charge = Field(default=62_400.0, description="C V: 62 400 e are 10 fF and 1 V")
    exposure: Annotated[float, Quantity("time", least=1e-6, most=10)] = Field(
        default=0.02, examples=["20 ms"], description="exposure of every frame"
    )
    shortest: Annotated[float, Quantity("time", least=1e-9, most=1)] = Field(
        default=1e-6, examples=["1 us"], description="least time from reset to pulse"
    )
    bits: Annotated[int, Field(ge=1, le=16)] = Field(
        default=16, description="number of bits of a value"
    )
    reset_noise: Noise = Field(default=40.0, description="sqrt(kTC)/q: 40 e of 10 fF at 25 degC")
    dark_current: Current = Field(default=6240.0, description="1 nA/cm2 on 10 x 10 um")
    pitch: Annotated[float, Quantity("length", above=0, most=1000)] = Field(
        default=10.0, examples=["10 um"], description="pitch of square pixels; assumed"
    )
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.7, description="quantum efficiency at 555 nm, fill factor included; assumed"
    )
    clock: Annotated[float, Quantity("frequency", least=1e3, most=1e9)] = Field(
        default=40e6, examples=["40 MHz"], description="values a second that are read out"
    )
    frame_rate: Annotated[float, Quantity("frequency", above=0, most=1e5)] | None = Field(
        default=None, description="frame rate; as fast as exposure and readout allow when absent"
    )

    @model_validator(mode="after")
    def _check(self) -> PulseSection:
        if self.shortest > self.exposure:
            raise InputError(
                "imager.shortest", f"at most the exposure, {amount(self.exposure, 's', 12)}",
                amount(self.shortest, "s"), "lower it, or lengthen imager.exposure",
            )  # fmt: skip
        return self


class PwmSection(PulseSection):
    """Pulse-width modulation: the time from reset to threshold. `bits` of the exposure's time; the
    largest value says that the threshold was not reached."""

    kind: Literal["pwm"]


class PfmSection(PulseSection):
    """Pulse-frequency modulation: the number of pulses in an exposure."""

    kind: Literal["pfm"]
    threshold: Charge = 1000.0
