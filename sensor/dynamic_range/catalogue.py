"""Default sensors and converters of a budget.

The field `source` names the published figures. All other figures are assumed and have the order of
magnitude that is usual for such a part. No part has a price: a budget that limits the price must
list its parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sensor.device.ktc import ktc_electrons
from sensor.dynamic_range.converter import Converter
from sensor.dynamic_range.noise import BOLTZMANN_EV, ZERO_CELSIUS, DarkLaw, SensorNoise


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

_TYPICAL: Final = "assumed: power, and a signal-to-noise ratio of a sine of full scale of "
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
