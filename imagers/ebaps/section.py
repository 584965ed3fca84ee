"""The [imager] section of the EBAPS."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from cosim import InputError
from cosim.config.quantity import Quantity, Section, Temperature, Wavelength
from imagers.common.kind import Device, ImagerSection, Writes

_GAASP: Final = 730.0
"""Wavelength from which on a photocathode of GaAsP has no response, nm."""


class EbapsBoardSection(Section):
    """[imager.board]: the board clock by clock, for the first frames: 50 us of run time for a
    pixel of each."""

    frames: Annotated[int, Field(ge=1, le=100)] = Field(
        default=1, description="live frames that pass clock by clock, after the dark frames"
    )
    memory_clock: Annotated[float, Quantity("frequency", least=1e6, most=1e9)] = Field(
        default=200e6, examples=["200 MHz"]
    )
    link_clock: Annotated[float, Quantity("frequency", least=10e6, most=90e6)] = Field(
        default=85e6, examples=["85 MHz"], description="clock of Camera Link, and of both FPGAs"
    )
    stall: Annotated[float, Field(ge=0, le=0.9)] = Field(
        default=0.0, description="share of the memory's clocks in which it is not ready"
    )
    fifo_words: Literal[128, 256, 512, 1024, 2048] = Field(
        default=512, description="depth of each FIFO, words of 128 bits"
    )
    jitter: Annotated[float, Quantity("time", least=0, most=12.5e-9)] = Field(
        default=50e-12, examples=["50 ps"], description="RMS, of the converter's data lines"
    )
    skew: Annotated[float, Quantity("time", least=0, most=12.5e-9)] = Field(
        default=1e-9, examples=["1 ns"], description="largest difference of a line from the mean"
    )


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
    photocathode: Literal["GaAs", "GaAsP"] = "GaAs"
    illuminant: Literal["lamp", "daylight", "night-sky", "monochromatic"] = Field(
        default="lamp", description="spectrum of the light: a lamp of 2856 K, a black body of "
        "6504 K, the moonless sky, or one wavelength",
    )  # fmt: skip
    wavelength: Wavelength | None = Field(
        default=None, description="wavelength of monochromatic light", examples=["640 nm"]
    )
    temperature: Temperature = 27.0
    device_seed: Device = 1
    writes: Writes = ()
    board: EbapsBoardSection | None = Field(
        default=None, description="runs the board clock by clock for the first frames"
    )

    @model_validator(mode="after")
    def _check(self) -> EbapsSection:
        line, nm = self.illuminant == "monochromatic", self.wavelength
        key, given = "imager.wavelength", "absent" if nm is None else f"{nm:g} nm"
        if line and nm is None:
            raise InputError(
                key, "given with monochromatic light", given,
                "write --set imager.wavelength='640 nm'",
            )  # fmt: skip
        if not line and nm is not None:
            raise InputError(
                key, f"absent with imager.illuminant = {self.illuminant}", given,
                "write --set imager.illuminant=monochromatic",
            )  # fmt: skip
        if self.photocathode == "GaAsP" and nm is not None and nm >= _GAASP:
            raise InputError(
                key, f"below {_GAASP:g} nm, where GaAsP ends", given,
                "lower it, or write --set imager.photocathode=GaAs",
            )  # fmt: skip
        return self
