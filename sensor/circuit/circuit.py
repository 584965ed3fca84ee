"""The circuit of a pixel as numbers: its reset noise, what makes it stiff, and the section
[sensor.circuit] that gives this to the reference tier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from cosim.clock import PS
from cosim.config.amounts import at_least
from cosim.config.quantity import Capacitance, Duration, Quantity, Section, Time

_FEMTO = 1e-15
BOLTZMANN: Final = 1.380649e-23
"""J/K, exact by definition of the SI (2019)."""
ELEMENTARY_CHARGE: Final = 1.602176634e-19
"""C, exact by definition of the SI (2019)."""


@dataclass(frozen=True)
class Circuit:
    """C(V) dV/dt = I - V C0 / leak, then a comparator of one pole, then a reset switch.

    V is the swing, zero when the pixel is empty and rising with charge.

    A leak as fast as the comparator is refused (the closed forms divide by their difference).

    Attributes:
        capacitance: farads at zero swing.
        nonlinearity: relative change of C per volt of swing, C = C0 (1 + nonlinearity V).
        leak: seconds in which a signal on C0 decays toward zero by e, inf for none.
        gain: the comparator's open-loop gain A.
        bandwidth: its gain-bandwidth product in Hz; its time constant is A / (2 pi bandwidth).
        trip: volts that its output must swing to count as a spike; 0 is no delay.
        resistance: ohms of the closed reset switch; 0 empties the pixel at once.
        reset_time: seconds that it stays closed, more than 0 where it has a resistance.
    """

    capacitance: float
    nonlinearity: float = 0.0
    leak: float = math.inf
    gain: float = 1e4
    bandwidth: float = 1e8
    trip: float = 0.0
    resistance: float = 0.0
    reset_time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("capacitance", "leak", "gain", "bandwidth"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name):g}")
        for name in ("trip", "resistance", "reset_time"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be 0 or more, not {getattr(self, name):g}")
        for name in ("capacitance", "gain", "bandwidth", "nonlinearity"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, not {getattr(self, name):g}")
        if self.resistance > 0 and self.reset_time == 0:
            raise ValueError("reset_time must be above 0 where there is a resistance, not 0")
        if self.trip > 0 and self.leak < 4 * self.pole:
            least = at_least(4 * self.pole)
            raise ValueError(
                f"leak must be at least {least} s, 4 time constants of the comparator, not "
                f"{self.leak:g} s"
            )

    @property
    def pole(self) -> float:
        """The comparator's time constant, seconds."""
        return self.gain / (2 * math.pi * self.bandwidth)

    @property
    def electrons(self) -> float:
        """Electrons for a volt at zero swing."""
        return self.capacitance / ELEMENTARY_CHARGE

    def swing(self, charge: float) -> float:
        """Volts of a charge in electrons: the root of C0 (V + nonlinearity V^2 / 2) = charge.

        Raises ValueError where C has fallen to a quarter or less by then.
        """
        linear = charge / self.electrons
        inside = 1 + 2 * self.nonlinearity * linear
        if not inside >= 1 / 16:
            raise ValueError(
                f"nonlinearity must leave a quarter of C at {charge:g} e, "
                f"not {self.nonlinearity:g} a volt"
            )
        return 2 * linear / (1 + math.sqrt(inside))

    def packed(self) -> npt.NDArray[np.float64]:
        """For the compiled loops, time in ps: leak, nonlinearity, electrons a volt, gain, pole,
        trip, resistance x C0, reset time."""
        return np.array(
            [
                self.leak * PS,
                self.nonlinearity,
                self.electrons,
                self.gain,
                self.pole * PS,
                self.trip,
                self.resistance * self.capacitance * PS,
                self.reset_time * PS,
            ]
        )


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
        """The circuit in SI units."""
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


def ktc_electrons(farad: float, kelvin: float = 300.0) -> float:
    """Reset noise of a capacitance in electrons: sqrt(k T C) / q."""
    return math.sqrt(BOLTZMANN * kelvin * farad) / ELEMENTARY_CHARGE
