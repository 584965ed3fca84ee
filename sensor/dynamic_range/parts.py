"""The parts of a chain: a sensor's own noise, the converter, and defaults of both.

Noise of a sensor (Wang et al., patent of 2017) by temperature, pixel clock and signal: shot, reset,
white, dark and transfer noise, in quadrature: they are independent. Reset and white noise go with
the square root of the absolute temperature, transfer (clocking) noise with that of the clock's
frequency; dark noise is the shot noise of the dark charge and steeper.

The field `source` names the published figures. All other figures are assumed and have the order of
magnitude that is usual for such a part. No part has a price: a budget that limits the price must
list its parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from sensor.circuit.circuit import ktc_electrons
from sensor.device.pattern import DOUBLING, dark_current

ZERO_CELSIUS: Final = 273.15
"""K, by definition of the Celsius scale."""
BOLTZMANN_EV: Final = 8.617333262e-5
"""eV/K, from the SI's exact constants (2019)."""
RULE_FACTOR: Final = 2
"""How far the converter's dynamic range is to exceed the sensor's (Wang et al.)."""
_TYPICAL: Final = "assumed: power, and a signal-to-noise ratio of a sine of full scale of "


def decibels(ratio: float) -> float:
    """20 log10 of a ratio above 0."""
    return 20 * math.log10(ratio)


def as_ratio(db: float) -> float:
    """The ratio of so many decibels."""
    return float(10 ** (db / 20))


def sensor_dynamic_range(saturation: float, noise: float) -> float:
    """A sensor's dynamic range, dB: saturation over noise, both in electrons (Wang et al., patent
    of 2017, its first formula). 40 000 e over 25 e are 64.08 dB; without noise it has no end."""
    return decibels(saturation / noise) if noise > 0 else math.inf


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


_PER_BIT: Final = decibels(2)


@dataclass(frozen=True)
class Converter:
    """An analog to digital converter.

    Attributes:
        bits: bits of a value.
        full_scale: volts that the largest value stands for.
        noise: volts RMS at the input, without quantisation.
        hertz: most samples a second.
    """

    bits: int
    full_scale: float
    noise: float = 0.0
    hertz: float = math.inf

    @property
    def step(self) -> float:
        """Volts of one DN: full scale is the largest value."""
        return self.full_scale / ((1 << self.bits) - 1)

    @property
    def total_noise(self) -> float:
        """Volts RMS at the input, with the quantisation noise of a step, step/sqrt(12)."""
        return math.hypot(self.noise, self.step / math.sqrt(12))

    @property
    def dynamic_range(self) -> float:
        """Full scale over RMS noise, dB: measured as a sensor's is."""
        return decibels(self.full_scale / self.total_noise)


def bits_for(db: float, by: Literal["noise", "steps"] = "noise") -> int:
    """Bits of a noiseless converter with this dynamic range. by: full scale over the RMS of its
    quantisation noise, as a sensor's range is meant, or over one step, 6.02 dB a bit."""
    extra = decibels(math.sqrt(12)) if by == "noise" else 0.0
    return max(math.ceil((db - extra) / _PER_BIT - 1e-12), 1)


@dataclass(frozen=True)
class ConverterRule:
    """The rule "the converter has more than twice the sensor's dynamic range".

    The rule has two readings; `holds` uses the first.

    Attributes:
        sensor: dynamic range of the sensor, dB.
        converter: dynamic range of the converter, dB.
    """

    sensor: float
    converter: float

    @property
    def as_ratio(self) -> float:
        """Required dB if "twice" applies to the ratio: the sensor's value plus 6.02 dB."""
        return self.sensor + decibels(RULE_FACTOR)

    @property
    def as_decibels(self) -> float:
        """Required dB if "twice" applies to the decibels: the square of the ratio."""
        return RULE_FACTOR * self.sensor

    @property
    def loss(self) -> float:
        """dB that a converter which just meets `as_ratio` takes from the sensor's range.

        Its noise is half the sensor's: 10 log10(1 + 1/4) = 0.97.
        """
        return 10 * math.log10(1 + 1 / RULE_FACTOR**2)

    @property
    def holds(self) -> bool:
        """Whether the converter meets `as_ratio`."""
        return self.converter > self.as_ratio

    @property
    def holds_in_decibels(self) -> bool:
        """Whether the converter meets `as_decibels`."""
        return self.converter > self.as_decibels


def converter_rule(sensor_db: float, converter: Converter) -> ConverterRule:
    """The rule for a sensor of `sensor_db` dB and a converter.

    The document does not say what is doubled. For a sensor of 64 dB, twice the ratio requires 10
    bits and twice the decibels 20 bits. No converter at a camera's pixel rate has 20 bits, so the
    ratio is used.
    """
    return ConverterRule(sensor_db, converter.dynamic_range)


@dataclass(frozen=True)
class SensorPart:
    """A sensor that a budget may choose.

    Attributes:
        full_well: electrons, linear.
        sensitivity: volts an electron.
        watts: power; None where unknown, as price, in any one unit.
        source: source of the part's figures.
    """

    name: str
    full_well: float
    sensitivity: float
    noise: SensorNoise
    watts: float | None = None
    price: float | None = None
    source: str = "given"


@dataclass(frozen=True)
class ConverterPart:
    """A converter that a budget may choose.

    Attributes:
        watts, price: power and price as of a sensor.
    """

    name: str
    converter: Converter
    watts: float | None = None
    price: float | None = None
    source: str = "given"


KODAK: Final = SensorPart(
    "kodak-full-frame", 40_000, 25e-6,
    SensorNoise(0, 15, 20, DarkLaw(30), 25, 27e6), 0.5, None,
    "40 000 e and 25 e at 27 MHz: Wang et al. 2017; how the 25 e divide into 15 white and 20 "
    "transfer, sensitivity, dark current and power are assumed",
)  # fmt: skip
"""The document's example: a full-frame device with 25 e of noise at 27 MHz."""

SENSORS: Final = (
    KODAK,
    SensorPart(
        "dalsa", 250_000, 10e-6,
        SensorNoise(0, 30, 26.5, DarkLaw(200), 25, 30e6), 0.8, None,
        "linear full well of 2500 mV: Wang et al. 2017; the rest is assumed",
    ),
    SensorPart(
        "cmos-3t", 62_400, 16e-6,
        SensorNoise(
            2**0.5 * ktc_electrons(10e-15, 25 + ZERO_CELSIUS), 10, 0, DarkLaw(6240), 25, 20e6
        ),
        0.2, None,
        "10 fF and 1 V: reset noise sqrt(2 kTC), reset after reading; 1 nA/cm2 on 10 x 10 um; "
        "follower noise and power are assumed",
    ),
    SensorPart(
        "ccd97", 130_000, 5.3e-6,
        SensorNoise(0, 0, 2.2, DarkLaw(400, 20, activation=9080 * BOLTZMANN_EV), 20, 50e3), 1.0,
        None,
        "2.2 e at 50 kHz and 400 e/s at 20 degC with its 9080 K: e2v CCD97 data; without "
        "multiplication; full well, sensitivity and power are assumed",
    ),
    SensorPart(
        "cmos-4t", 30_000, 40e-6,
        SensorNoise(0, 2, 0, DarkLaw(5), 25, 30e6), 0.3, None, "assumed",
    ),
)  # fmt: skip
"""Default sensors of a budget."""

CONVERTERS: Final = (
    ConverterPart("8-bit", Converter(8, 2, 1e-3, 40e6), 0.05, None, "assumed"),
    ConverterPart("12-bit", Converter(12, 2, 174e-6, 60e6), 0.2, None, _TYPICAL + "70 dB"),
    ConverterPart("14-bit", Converter(14, 2, 137e-6, 80e6), 0.35, None, _TYPICAL + "74 dB"),
    ConverterPart(
        "16-bit", Converter(16, 2, 89e-6, 80e6), 0.8, None,
        "16 bits at 80 MS/s as of the EBAPS board; " + _TYPICAL + "78 dB",
    ),
)  # fmt: skip
"""Default converters of a budget."""
