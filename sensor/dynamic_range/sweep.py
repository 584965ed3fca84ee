"""Evaluates every combination of parts and settings that a budget allows and ranks them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

from sensor.dynamic_range.chain import Chain, Mapping
from sensor.dynamic_range.parts import (
    CONVERTERS,
    SENSORS,
    ConverterPart,
    ConverterRule,
    SensorPart,
    converter_rule,
    sensor_dynamic_range,
)

_TIE: Final = 6
"""Dynamic ranges that agree to this many decimals of a dB count as equal."""


OUTPUT: Final = Mapping(2.2, 8)
"""Eight bits and the gamma of displays."""


@dataclass(frozen=True)
class Budget:
    """What may be chosen, and what limits it.

    Attributes:
        temperatures: temperatures of the sensor, degrees Celsius.
        clocks: Hz, pixels a second.
        circuits: volts RMS at the sensor's output.
        analogs, digitals: gains.
        seconds: exposures, over which dark charge gathers.
        rule: reading of "twice the sensor's dynamic range" that a converter must fulfil.
        watts, price: most of sensor, converter and cooler together.
        least: most electrons that the signal of SNR 1 may have.
        ambient, watts_per_kelvin: a cooler takes so much for every kelvin that the sensor is below
            its surroundings (a straight line, assumed).
        mapping: map to the output.
    """

    sensors: tuple[SensorPart, ...] = SENSORS
    converters: tuple[ConverterPart, ...] = CONVERTERS
    temperatures: tuple[float, ...] = (-10.0, 25.0, 50.0)
    clocks: tuple[float, ...] = (20e6,)
    circuits: tuple[float, ...] = (1e-4, 5e-4)
    analogs: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0)
    digitals: tuple[float, ...] = (1.0, 2.0, 4.0)
    seconds: float = 0.02
    rule: Literal["ratio", "decibels", "none"] = "ratio"
    watts: float | None = None
    price: float | None = None
    least: float | None = None
    ambient: float = 25.0
    watts_per_kelvin: float = 0.05
    mapping: Mapping = OUTPUT

    @property
    def size(self) -> int:
        """Number of combinations."""
        return (
            len(self.sensors) * len(self.converters) * len(self.temperatures) * len(self.clocks)
            * len(self.circuits) * len(self.analogs) * len(self.digitals)
        )  # fmt: skip


@dataclass(frozen=True)
class Choice:
    """One combination of parts and settings of a budget.

    Attributes:
        sensor: sensor part.
        converter: converter part.
        celsius: temperature of the sensor, degrees Celsius.
        hertz: pixel clock, pixels a second.
        circuit: circuit noise at the sensor's output, volts RMS.
        analog, digital: gains.
    """

    sensor: SensorPart
    converter: ConverterPart
    celsius: float
    hertz: float
    circuit: float
    analog: float
    digital: float


@dataclass(frozen=True)
class Judged:
    """What a choice gives.

    Attributes:
        rule: rule of the choice's converter.
        watts, price: power and price; None where a part's are unknown.
        faults: limits that it breaks, in words.
        mapped: dB that the output of few bits keeps.
    """

    choice: Choice
    chain: Chain
    rule: ConverterRule
    watts: float | None
    price: float | None
    mapped: float
    faults: tuple[str, ...]


def _choices(budget: Budget) -> Iterator[Choice]:
    for one in product(
        budget.sensors, budget.converters, budget.temperatures, budget.clocks, budget.circuits,
        budget.analogs, budget.digitals,
    ):  # fmt: skip
        yield Choice(*one)


def _sum(*parts: float | None) -> float | None:
    known = [p for p in parts if p is not None]
    return sum(known) if len(known) == len(parts) else None


def _over(what: str, value: float | None, most: float | None, unit: str) -> list[str]:
    if most is None:
        return []
    if value is None:
        return [f"{what} unknown"]
    # The sum of a few given figures may end a rounding above a limit that it meets.
    return [f"{what} {value:g}{unit}"] if value > most * (1 + 1e-12) else []


def _judge(choice: Choice, budget: Budget) -> Judged:
    sensor, part = choice.sensor, choice.converter
    noise = sensor.noise.at(choice.celsius, choice.hertz, budget.seconds)
    chain = Chain(
        sensor.full_well, noise, sensor.sensitivity, choice.circuit, part.converter,
        choice.analog, choice.digital,
    )  # fmt: skip
    rule = converter_rule(sensor_dynamic_range(sensor.full_well, noise), part.converter)
    cooler = max(budget.ambient - choice.celsius, 0) * budget.watts_per_kelvin
    watts = _sum(sensor.watts, part.watts, cooler)
    price = _sum(sensor.price, part.price)
    faults = []
    if part.converter.hertz < choice.hertz:
        faults.append(f"converter takes {part.converter.hertz / 1e6:g} MS/s")
    if budget.rule == "ratio" and not rule.holds:
        faults.append("converter rule (ratio)")
    if budget.rule == "decibels" and not rule.holds_in_decibels:
        faults.append("converter rule (decibels)")
    if budget.least is not None and chain.least > budget.least:
        faults.append(f"least signal {chain.least:.3g} e")
    faults += _over("power", watts, budget.watts, " W")
    faults += _over("price", price, budget.price, "")
    return Judged(
        choice, chain, rule, watts, price, budget.mapping.survives(chain.derived), tuple(faults)
    )


def sweep(budget: Budget) -> list[Judged]:
    """All choices: those within the limits first, then by derived dynamic range, and where that is
    the same by power, price and gains."""

    def order(one: Judged) -> tuple[float, ...]:
        far = float("inf")
        return (
            bool(one.faults), -round(one.chain.derived, _TIE),
            far if one.watts is None else one.watts, far if one.price is None else one.price,
            one.choice.analog, one.choice.digital,
        )  # fmt: skip

    return sorted((_judge(choice, budget) for choice in _choices(budget)), key=order)
