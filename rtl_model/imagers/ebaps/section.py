"""The [imager] section of the EBAPS."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Quantity, Temperature
from rtl_model.imagers.interface.section import Device, ImagerSection, Writes

__all__ = ["EbapsSection"]


class EbapsSection(ImagerSection):
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
