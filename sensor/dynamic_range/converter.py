"""The analog to digital converter: its own noise, and the rule that sizes it for a sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from sensor.dynamic_range.decibels import decibels

RULE_FACTOR: Final = 2
"""How far the converter's dynamic range is to exceed the sensor's (Wang et al.)."""
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
