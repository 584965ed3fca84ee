"""The plant of the cooling loop: chip, Peltier element and heat sink; and its thermistor.

Chip:  C_c dT_c/dt = P + (T_a - T_c)/R_a - Q_c,  Q_c = a T_c I - I^2 R/2 - K (T_h - T_c)
Sink:  C_h dT_h/dt = Q_h - (T_h - T_a)/R_h,      Q_h = a T_h I + I^2 R/2 - K (T_h - T_c)

with Seebeck coefficient a, resistance R and conductance K: the standard model of a thermoelectric
cooler. Above a current of a T_c/R, the element heats more than it pumps; a hot sink lowers this
limit. `strongest` is the current that cools most. At constant current both equations are linear in
the temperatures.

The document states only that a PID controller on the chip's thermistor holds -10 degC with the
Peltier element of the package. All values here are assumed; they are typical of such packages.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from imagers.emccd.pixels.chip import ZERO_CELSIUS

Values = npt.NDArray[np.float64]

_REFERENCE: Final = ZERO_CELSIUS + 25.0
"""Temperature at which the resistance of a thermistor is specified, K."""


class Temperatures(NamedTuple):
    """Temperatures of the chip and of the heat sink, K."""

    chip: float
    sink: float


@dataclass(frozen=True)
class Plant:
    """Chip, Peltier element and heat sink.

    Attributes:
        seebeck: Seebeck coefficient of the element, V/K.
        resistance: electrical resistance of the element, ohm.
        conductance: thermal conductance of the element, W/K.
        chip_capacity, sink_capacity: heat capacities, J/K.
        chip_power: power that the chip dissipates, W.
        chip_to_air, sink_to_air: thermal resistances, K/W.
    """

    seebeck: float = 0.020
    resistance: float = 2.5
    conductance: float = 0.064
    chip_capacity: float = 15.0
    sink_capacity: float = 150.0
    chip_power: float = 0.5
    chip_to_air: float = 60.0
    sink_to_air: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < math.inf and name != "chip_power":
                raise ValueError(f"{name} must be positive, not {value:g}")

    def _rates(
        self, amps: float, ambient: float
    ) -> tuple[float, float, float, float, float, float]:
        """a_cc, a_cs, a_sc, a_ss, b_c, b_s of `linear`."""
        pump, k = self.seebeck * amps, self.conductance
        joule = amps * amps * self.resistance / 2.0
        chip, sink = self.chip_capacity, self.sink_capacity
        return (
            -(1 / self.chip_to_air + pump + k) / chip,
            k / chip,
            k / sink,
            (pump - k - 1 / self.sink_to_air) / sink,
            (self.chip_power + ambient / self.chip_to_air + joule) / chip,
            (joule + ambient / self.sink_to_air) / sink,
        )

    def linear(self, amps: float, ambient: float) -> tuple[Values, Values]:
        """A (2, 2) and b (2,) of dT/dt = A T + b for T = (chip, sink), at a constant current."""
        rates = self._rates(amps, ambient)
        return np.array(rates[:4]).reshape(2, 2), np.array(rates[4:])

    def advance(
        self, state: Temperatures, amps: float, ambient: float, seconds: float
    ) -> Temperatures:
        """Temperatures after `seconds` at constant current (A) and ambient temperature (K), by one
        classical Runge-Kutta step. Its error is about (seconds / 100 s)^5 for the default plant."""
        a00, a01, a10, a11, b0, b1 = self._rates(amps, ambient)

        def slope(x: float, y: float) -> tuple[float, float]:
            return a00 * x + a01 * y + b0, a10 * x + a11 * y + b1

        x, y = state
        h = seconds
        p0, q0 = slope(x, y)
        p1, q1 = slope(x + h / 2 * p0, y + h / 2 * q0)
        p2, q2 = slope(x + h / 2 * p1, y + h / 2 * q1)
        p3, q3 = slope(x + h * p2, y + h * q2)
        return Temperatures(
            x + h / 6 * (p0 + 2 * p1 + 2 * p2 + p3), y + h / 6 * (q0 + 2 * q1 + 2 * q2 + q3)
        )

    def steady(self, amps: float, ambient: float) -> Temperatures:
        """Steady state at a constant current: -A^-1 b. Raises ValueError if there is none."""
        a, b = self.linear(amps, ambient)
        if not (np.linalg.eigvals(a).real < 0).all():
            raise ValueError(f"{amps:g} A must be less: the sink runs away")
        chip, sink = np.linalg.solve(a, -b)
        return Temperatures(float(chip), float(sink))

    def strongest(self, ambient: float, most: float) -> float:
        """Current, at most `most` A, with the lowest steady temperature of the chip."""
        from scipy.optimize import minimize_scalar

        found = minimize_scalar(
            lambda amps: self.steady(amps, ambient).chip, bounds=(0.0, most), method="bounded"
        )
        return float(found.x)

    def holding(self, kelvin: float, ambient: float, most: float) -> float:
        """Current that holds the chip at `kelvin`. Raises ValueError if no current up to the
        strongest does."""
        from scipy.optimize import brentq

        top = self.strongest(ambient, most)
        if self.steady(top, ambient).chip > kelvin or self.steady(0.0, ambient).chip < kelvin:
            raise ValueError(f"ambient must let {kelvin:g} K be reached, not {ambient:g} K")
        return float(brentq(lambda amps: self.steady(amps, ambient).chip - kelvin, 0.0, top))


@dataclass(frozen=True)
class Thermistor:
    """A thermistor R(T) = R_25 exp(B (1/T - 1/298.15 K)) in a voltage divider, with its converter.
    A lower temperature gives a larger code. All values are assumed (a common NTC).

    Attributes:
        at_25c: resistance R_25, ohm.
        beta: B, K.
        above: resistance of the upper part of the divider, ohm.
        bits: bits of the converter.
        coldest, hottest: range, K; a code beyond it means an open or a shorted thermistor.
    """

    at_25c: float = 10_000.0
    beta: float = 3950.0
    above: float = 33_000.0
    bits: int = 14
    coldest: float = ZERO_CELSIUS - 60.0
    hottest: float = ZERO_CELSIUS + 100.0

    @property
    def full(self) -> int:
        """Largest code."""
        return (1 << self.bits) - 1

    def ohms(self, kelvin: float) -> float:
        """Resistance at a temperature, ohm."""
        return self.at_25c * math.exp(self.beta * (1.0 / kelvin - 1.0 / _REFERENCE))

    def code(self, kelvin: float, noise: float = 0.0) -> int:
        """Code of the converter; `noise` is added before rounding, in codes."""
        r = self.ohms(kelvin)
        return min(max(round(self.full * r / (r + self.above) + noise), 0), self.full)

    def kelvin(self, code: float) -> float:
        """Temperature of a code with 0 < code < full, K."""
        share = code / self.full
        ohms = self.above * share / (1.0 - share)
        return 1.0 / (math.log(ohms / self.at_25c) / self.beta + 1.0 / _REFERENCE)

    def slope(self, kelvin: float) -> float:
        """Slope of the code, codes/K; negative."""
        r = self.ohms(kelvin)
        share = r / (r + self.above)
        return -self.full * share * (1.0 - share) * self.beta / kelvin**2
