"""[sensor.circuit]: what makes the pixel stiff, for the reference tier."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from cosim.config.quantity import Capacitance, Duration, Quantity, Section, Time
from sensor.circuit.circuit import Circuit

_FEMTO = 1e-15


class CircuitSection(Section):
    """The pixel's capacitance, leak, comparator and reset switch. Without a key its fault is
    absent. Nothing of it is published for the chips here."""

    capacitance: Capacitance = Field(description="capacitance at zero swing")
    nonlinearity: Annotated[float, Field(ge=-1, le=10)] = Field(
        default=0.0, description="relative change of the capacitance for a volt of swing"
    )
    leak: Duration | None = Field(
        default=None,
        examples=["1 s"],
        description="time constant of the signal's decay; none when absent",
    )
    gain: Annotated[float, Field(ge=1, le=1e9)] = Field(
        default=1e4, description="gain of the comparator, open loop"
    )
    bandwidth: Annotated[float, Quantity("frequency", above=0, most=1e13)] = Field(
        default=1e8, examples=["100 MHz"], description="gain-bandwidth product of the comparator"
    )
    trip: Annotated[float, Quantity("voltage", least=0, most=100)] = Field(
        default=0.0,
        description="voltage that the comparator's output swings to fire; 0 is no delay",
    )
    resistance: Annotated[float, Quantity("resistance", least=0, most=1e15)] = Field(
        default=0.0,
        description="resistance of the closed reset switch; 0 empties the pixel at once",
    )
    reset_time: Time = Field(
        default=0.0, examples=["100 ns"], description="time that the reset switch stays closed"
    )

    @model_validator(mode="after")
    def _stands(self) -> CircuitSection:
        _ = self.circuit  # what the keys must be together
        return self

    @property
    def circuit(self) -> Circuit:
        """In SI units."""
        return Circuit(
            self.capacitance * _FEMTO,
            self.nonlinearity,
            math.inf if self.leak is None else self.leak,
            self.gain,
            self.bandwidth,
            self.trip,
            self.resistance,
            self.reset_time,
        )
