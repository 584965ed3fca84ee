"""The [board] section: a test board behind a serial port, or one that is started in a simulator."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cosim import InputError
from cosim.config.quantity import Section

_SLOWEST = 9600
"""Baud of the cycle model: each bit takes a simulated clock its time, minutes for slower lines."""


class BoardSection(Section):
    """A board is brought up and its frames are held against the cycle model."""

    port: str = Field(
        default="virtual",
        description="a device, any URL of pyserial, udp:HOST[:PORT], or virtual: a board in a "
        "simulator is started",
    )
    level: Literal["bytes", "pins", "model"] = Field(
        default="bytes",
        description="level of a virtual board: the Verilog behind bytes or pins, or the cycle "
        "model, which needs no Verilator",
    )  # fmt: skip
    baud: Annotated[int, Field(ge=2001, le=12_000_000)] = 115_200
    dtr: Literal["on", "off"] | None = Field(
        default=None, description="DTR of a serial port, which resets some boards; on when absent"
    )
    rts: Literal["on", "off"] | None = Field(
        default=None, description="RTS of a serial port, likewise; on when absent"
    )
    rows: Annotated[int, Field(ge=1, le=4095)] | None = Field(
        default=None, description="rows of the board; a virtual one has 32 when absent"
    )
    columns: Annotated[int, Field(ge=1, le=4096)] | None = Field(
        default=None, description="columns of the board; a virtual one has 32 when absent"
    )
    lanes: Literal[32, 64] | None = Field(
        default=None, description="pixels a clock computes; a virtual board has 32 when absent"
    )
    frames: Annotated[int, Field(ge=1, le=65_536)] = Field(
        default=24, description="frames of the captured stream, one burst"
    )
    faults: tuple[str, ...] = Field(
        default=(), max_length=64, description='faults of a virtual board, such as ["stuck=3,7"]'
    )
    csr: str | None = Field(default=None, description="csr.csv of the design; ours when absent")
    time_scale: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        default=None, description="seconds of ours to one of a simulated board's clock"
    )

    @model_validator(mode="after")
    def _model_is_not_slower(self) -> BoardSection:
        if self.port == "virtual" and self.level == "model" and self.baud < _SLOWEST:
            raise InputError(
                "board.baud", f"at least {_SLOWEST} with board.level = model, which has each bit",
                str(self.baud), "raise it, or write --set board.level=bytes",
            )  # fmt: skip
        return self
