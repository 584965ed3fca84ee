"""The section [camera] of kind "frames": a camera with a rolling shutter in front of the panel."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cosim import InputError
from cosim.config.quantity import Charge, Noise, Quantity, Section
from display.section import Size

Span = Annotated[float, Quantity("time", above=0, most=10)]


class FramesSection(Section):
    """A camera with a rolling shutter, as in a phone. Its lens is ideal: each of its pixels sees a
    box of whole panel pixels. Every default is assumed."""

    kind: Literal["frames"]
    frame_rate: Annotated[float, Quantity("frequency", least=1, most=20e3)] = Field(
        default=60.0, examples=["60 Hz"]
    )
    exposure: Span = Field(default=2e-3, examples=["2 ms"], description="exposure of every row")
    readout: Annotated[float, Quantity("time", least=0, most=10)] = Field(
        default=8e-3,
        examples=["8 ms"],
        description="time over which the rows begin, the first to the last; 0 is a global shutter",
    )
    width: Size | None = Field(
        default=None, description="columns, a divisor of the panel's; by default that of the panel"
    )
    height: Size | None = Field(
        default=None, description="rows, a divisor of the panel's; by default that of the panel"
    )
    full_well: Charge = Field(default=6000.0, examples=["6000 e"])
    white: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.8, description="share of the full well that the panel's white fills"
    )
    read_noise: Noise = Field(default=2.0, examples=["2 e"], description="RMS")
    bits: Annotated[int, Field(ge=1, le=16)] = Field(default=10, description="bits of a value")

    @model_validator(mode="after")
    def _fits_a_frame(self) -> FramesSection:
        frame = 1 / self.frame_rate
        most = f"{1e3 * frame:.12g} ms"
        for name in ("exposure", "readout"):
            seconds = getattr(self, name)
            if seconds > frame * (1 + 1e-9):
                raise InputError(
                    f"camera.{name}", f"at most a frame, {most}",
                    f"{1e3 * seconds:.12g} ms",
                    f"write --set camera.{name}='{most}', or lower camera.frame_rate",
                )  # fmt: skip
        return self
