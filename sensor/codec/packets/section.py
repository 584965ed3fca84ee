"""The [code] section: how a stream is coded between two parts of a chain."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field, field_validator, model_validator

from cosim import InputError
from cosim.config.quantity import Quantity, Section
from sensor.codec.packets.catalogue import KINDS, StreamCode
from sensor.codec.packets.event import MOST_EVENT_CYCLES
from sensor.codec.packets.layered import LAYERS
from sensor.codec.packets.packet import MOST_CYCLES
from sensor.codec.packets.rate import RateControl

CYCLES: Final = 128
"""Cycles of a packet where nothing else decides."""
BUFFER: Final = 20e-3
"""Send buffer where nothing else decides, s."""


class CodeSection(Section):
    """The code of a stream, and the rate that it may take."""

    kind: Literal[tuple(KINDS)] = "layered"  # type: ignore[valid-type]  # names of the catalogue
    aim: Literal["picture", "delay"] = Field(
        default="picture",
        description="what is kept where the link carries less than the stream brings",
    )
    cycles: Annotated[int, Field(ge=32, le=MOST_CYCLES, multiple_of=32)] | None = Field(
        default=None,
        examples=[64],
        description="cycles in a packet: fewer for less delay, more for fewer bits; auto, or "
        "absent: as few as the link leaves",
    )
    tile: Annotated[int, Field(ge=8, le=128, multiple_of=8)] = Field(
        default=64, description="side of a tile, pixels; a lost packet damages one tile"
    )
    layers: Annotated[int, Field(ge=1, le=LAYERS)] = Field(
        default=LAYERS, description=f"layered: layers that are made; {LAYERS} lose nothing"
    )
    k: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=3.0, description="statistical: limit of a change, in standard deviations"
    )
    refine: Annotated[int, Field(ge=0, le=255)] = Field(
        default=8, description="statistical: widths in the mean after a change, 0 for none"
    )
    rate: Annotated[float, Quantity("bit rate", above=0, most=1e15)] | None = Field(
        default=None, description="bits a second, at most; what the link carries when absent"
    )
    buffer: Annotated[float, Quantity("time", above=0, most=10)] | None = Field(
        default=None,
        examples=["3 ms"],
        description="time that a packet may wait before it is sent; auto, or absent: as little "
        "as the packets need",
    )

    @field_validator("cycles", "buffer", mode="before")
    @classmethod
    def _chosen(cls, value: Any) -> Any:
        """`auto` is what is chosen when absent."""
        return None if value == "auto" else value

    @model_validator(mode="after")
    def _agrees(self) -> CodeSection:
        """Keys of another code would change nothing, which is a mistake."""
        for kind, keys in (("statistical", ("k", "refine")), ("layered", ("layers",))):
            fields = type(self).model_fields
            given = [key for key in keys if getattr(self, key) != fields[key].default]
            if given and self.kind != kind:
                raise InputError(
                    f"code.{given[0]}", f"given with code.kind = {kind}", f"with {self.kind}",
                    "leave it out",
                )  # fmt: skip
        if self.kind == "event" and (self.cycles or 0) > MOST_EVENT_CYCLES:
            raise InputError(
                "code.cycles", f"at most {MOST_EVENT_CYCLES} with event", f"{self.cycles}",
                f"write {MOST_EVENT_CYCLES}",
            )  # fmt: skip
        if self.refine == 1:
            raise InputError("code.refine", "0, or 2 to 255", "1", "write 2, or 0 for none")
        return self

    def code(self, threshold: float, threshold_noise: float = 0.0, phases: int = 1) -> StreamCode:
        """The code. threshold, threshold_noise: of the pixel, electrons; phases: as in
        `StreamCode`."""
        cycles = self.cycles or CYCLES
        if self.kind != "statistical":
            return StreamCode(self.kind, cycles, self.tile, self.layers, phases=phases)
        return StreamCode(
            self.kind, cycles, self.tile, LAYERS, self.k, self.refine, threshold,
            threshold_noise, phases,
        )  # fmt: skip

    def control(self, clock_hz: float, carried: float | None = None) -> RateControl | None:
        """The rate control at `clock_hz` cycles a second; None where nothing limits the rate.

        carried: bits a second that the link carries.
        """
        limits = [rate for rate in (self.rate, carried) if rate is not None]
        if not limits:
            return None
        buffer = BUFFER if self.buffer is None else self.buffer
        return RateControl(min(limits) / clock_hz, max(int(min(limits) * buffer) // 8, 1))
