"""The section [readout]: the digital way out of a latched chip, from its row scan to the host."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from cosim.config.quantity import Quantity, Section
from cosim.errors import InputError

Span = tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]]


class ReadoutSection(Section):
    """The row scan of the chip, the buffer behind it, and the link from there to the host."""

    rate: Annotated[float, Quantity("bit rate", least=1e6, most=1e12)] | None = Field(
        default=None,
        examples=["20 Gbit/s"],
        description="rate of the link from the buffer to the host, in whole kbit/s; as fast as "
        "the chip when absent",
    )
    buffer: Annotated[int, Field(ge=128, le=1_000_000_000)] = Field(
        default=128_000,
        description="bytes that wait for the link at most; a row has 128, a plane 128 000",
    )
    lanes: Annotated[int, Field(ge=1, le=512)] = Field(
        default=4,
        description="serial outputs of the chip that share its rate, a power of two; assumed",
    )
    rows: Span | None = Field(
        default=None,
        examples=[[250, 750]],
        description="rows [first, stop) that are read; all when absent",
    )
    columns: Span | None = Field(
        default=None,
        examples=[[0, 500]],
        description="columns [first, stop) that do not read 0; all when absent",
    )
    file: bool = Field(
        default=True, description="whether the bytes that the host gets are kept in readout.raw"
    )

    @model_validator(mode="after")
    def _can_be_built(self) -> ReadoutSection:
        if self.rate is not None and (self.rate / 1e3) % 1:
            raise InputError(
                "readout.rate", "a whole number of kbit/s", f"{self.rate:.12g} bit/s", "round it"
            )
        if self.lanes & (self.lanes - 1):
            raise InputError(
                "readout.lanes", "a power of two, so that a block of 512 bits fills all of them",
                str(self.lanes), f"set {1 << self.lanes.bit_length() - 1}",
            )  # fmt: skip
        for name in ("rows", "columns"):
            span = getattr(self, name)
            if span is not None and span[0] >= span[1]:
                raise InputError(
                    f"readout.{name}", "[first, stop) with first below stop", str(list(span)),
                    f"write [{min(span)}, {max(span) + (span[0] == span[1])}]",
                )  # fmt: skip
        return self
