"""A sensor's own noise by temperature, pixel clock and signal (Wang et al., patent of 2017).

Shot, reset, white, dark and transfer noise, in quadrature: they are independent. Reset and white
noise go with the square root of the absolute temperature, transfer (clocking) noise with that of
the clock's frequency; dark noise is the shot noise of the dark charge and steeper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sensor.device.pattern import DOUBLING, dark_current

ZERO_CELSIUS: Final = 273.15
"""K, by definition of the Celsius scale."""
BOLTZMANN_EV: Final = 8.617333262e-5
"""eV/K, from the SI's exact constants (2019)."""


@dataclass(frozen=True)
class DarkLaw:
    """Dark current over temperature.

    Attributes:
        current: electrons a second a pixel at `reference`, degrees Celsius.
        doubling: kelvin in which it doubles.
        activation: eV; where given it takes the doubling's place: I ~ T^3 exp(-E/kT), the form of a
            charge-coupled device in inverted mode (E = 0.782 eV for the CCD97: 9080 K).
    """

    current: float
    reference: float = 25.0
    doubling: float = DOUBLING
    activation: float | None = None

    def at(self, celsius: float) -> float:
        """Electrons a second."""
        if self.activation is None:
            return dark_current(self.current, celsius, self.reference, self.doubling)
        kelvin, base = celsius + ZERO_CELSIUS, self.reference + ZERO_CELSIUS
        steepness = self.activation / BOLTZMANN_EV * (1 / base - 1 / kelvin)
        return float(self.current * (kelvin / base) ** 3 * math.exp(steepness))


@dataclass(frozen=True)
class SensorNoise:
    """Noise of a sensor at its reference, electrons RMS.

    Attributes:
        reset, white: reset and white noise at `celsius`.
        transfer: transfer noise at `hertz`, the pixel clock.
        dark: its law.
    """

    reset: float
    white: float
    transfer: float
    dark: DarkLaw
    celsius: float = 25.0
    hertz: float = 30e6

    def parts(
        self, celsius: float, hertz: float, seconds: float = 0.0, signal: float = 0.0
    ) -> dict[str, float]:
        """Each part, electrons RMS.

        Args:
            seconds: time over which dark charge gathers.
            signal: electrons.
        """
        warm = math.sqrt((celsius + ZERO_CELSIUS) / (self.celsius + ZERO_CELSIUS))
        return {
            "shot": math.sqrt(signal),
            "reset": self.reset * warm,
            "white": self.white * warm,
            "dark": math.sqrt(self.dark.at(celsius) * seconds),
            "transfer": self.transfer * math.sqrt(hertz / self.hertz),
        }

    def at(self, celsius: float, hertz: float, seconds: float = 0.0, signal: float = 0.0) -> float:
        """All of it, electrons RMS."""
        return math.hypot(*self.parts(celsius, hertz, seconds, signal).values())
