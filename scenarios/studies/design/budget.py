"""The schema of a hardware budget (a TOML file and --set): the choices and their limits."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, field_validator

from cosim import InputError
from cosim.config.quantity import Current, Quantity, Section, Temperature, Time
from scenarios.assemble.schema.loading import assign
from scenarios.assemble.schema.messages import first_fault
from sensor.dynamic_range import (
    CONVERTERS,
    SENSORS,
    Budget,
    Converter,
    ConverterPart,
    DarkLaw,
    Mapping,
    SensorNoise,
    SensorPart,
)

__all__ = ["MOST_ROWS", "AdcSection", "BudgetFile", "SensorSection", "load_budget", "to_budget"]

MOST_ROWS = 20_000
"""Maximum number of choices of a budget."""

Well = Annotated[float, Quantity("charge", least=1, most=1e9)]
Electrons = Annotated[float, Quantity("charge", least=0, most=1e6)]
Clock = Annotated[float, Quantity("frequency", least=1, most=1e11)]
Volts = Annotated[float, Quantity("voltage", least=0, most=100)]
Scale = Annotated[float, Quantity("voltage", least=1e-6, most=1000)]
Conversion = Annotated[float, Quantity("conversion gain", least=1e-3, most=1e6)]
Watts = Annotated[float, Quantity("power", least=0, most=1e6)]
Price = Annotated[float, Field(ge=0, le=1e12)]
Gain = Annotated[float, Field(ge=1 / 1024, le=1024)]
Name = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f]+$")]

T = TypeVar("T")


def _several(value: object) -> object:
    return value if isinstance(value, list | tuple) else [value]


Many = Annotated[
    tuple[T, ...], BeforeValidator(_several), Field(min_length=1, max_length=MOST_ROWS)
]
"""One value or a list of them."""


class SensorSection(Section):
    """A sensor of the budget file; `part` converts it to a `SensorPart`. Noises apply at
    `noise_temperature` and `noise_clock`."""

    name: Name
    full_well: Well
    sensitivity: Conversion
    reset_noise: Electrons = 0.0
    white_noise: Electrons = 0.0
    transfer_noise: Electrons = 0.0
    dark_current: Current = 0.0
    dark_temperature: Temperature = 25.0
    dark_doubling: Annotated[float, Field(ge=1, le=100)] = 6.5
    dark_activation: Annotated[float, Field(ge=0.01, le=3)] | None = None
    noise_temperature: Temperature = 25.0
    noise_clock: Clock = 30e6
    power: Watts | None = None
    price: Price | None = None

    def part(self) -> SensorPart:
        dark = DarkLaw(
            self.dark_current, self.dark_temperature, self.dark_doubling, self.dark_activation
        )
        noise = SensorNoise(
            self.reset_noise, self.white_noise, self.transfer_noise, dark,
            self.noise_temperature, self.noise_clock,
        )  # fmt: skip
        return SensorPart(
            self.name, self.full_well, self.sensitivity * 1e-6, noise, self.power, self.price
        )


class AdcSection(Section):
    """A converter of the budget file; `part` converts it to a `ConverterPart`.

    Attributes:
        noise: RMS noise at the input without quantisation, V.
        rate: maximum sampling rate, Hz.
    """

    name: Name
    bits: Annotated[int, Field(ge=1, le=24)]
    full_scale: Scale
    noise: Volts = 0.0
    rate: Clock
    power: Watts | None = None
    price: Price | None = None

    def part(self) -> ConverterPart:
        converter = Converter(self.bits, self.full_scale, self.noise, self.rate)
        return ConverterPart(self.name, converter, self.power, self.price)


class BudgetFile(Section):
    """A hardware budget.

    Attributes:
        sensors, adcs: names of the parts to choose from; by default all parts of the file, or all
            known parts if the file has none.
        power, price: limits of the total for sensor, converter and cooler, W and any currency.
        least_signal: upper limit of the signal with SNR 1, e.
        cooler: power of the cooler for each kelvin of the sensor below `ambient`, W/K.
        gamma, output_bits: transfer curve and resolution of the output.
    """

    title: Annotated[str, Field(max_length=200)] = "A hardware budget"
    sensors: Many[str] | None = None
    adcs: Many[str] | None = None
    sensor: tuple[SensorSection, ...] = ()
    adc: tuple[AdcSection, ...] = ()
    temperature: Many[Temperature] = (-10.0, 25.0, 50.0)
    clock: Many[Clock] = (20e6,)
    circuit_noise: Many[Volts] = (1e-4, 5e-4)
    analog_gain: Many[Gain] = (1.0, 2.0, 4.0, 8.0)
    digital_gain: Many[Gain] = (1.0, 2.0, 4.0)
    exposure: Time = 0.02
    adc_rule: Literal["ratio", "decibels", "none"] = "ratio"
    power: Watts | None = None
    price: Price | None = None
    least_signal: Electrons | None = None
    ambient: Temperature = 25.0
    cooler: Annotated[float, Field(ge=0, le=1000)] = 0.05
    gamma: Annotated[float, Field(ge=1, le=10)] = 2.2
    output_bits: Annotated[int, Field(ge=1, le=16)] = 8

    @field_validator("temperature", "clock", "circuit_noise", "analog_gain", "digital_gain")
    @classmethod
    def _once(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        """Sorts the values and removes duplicates."""
        return tuple(sorted(set(values)))


def load_budget(path: str | None, assignments: Sequence[str] = ()) -> BudgetFile:
    """Loads and checks a budget; None for the built-in one. Raises InputError."""
    data: dict[str, Any] = {}
    if path is not None:
        try:
            data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as exc:  # a NUL in a name is a ValueError
            raise InputError(
                "the budget", "a TOML file", f"{path!r} ({exc})",
                "see docs/design-dynamic-range.md",
            ) from exc  # fmt: skip
    for assignment in assignments:
        assign(data, assignment)
    try:
        return BudgetFile.model_validate(data)
    except ValidationError as exc:
        remedy = "docs/design-dynamic-range.md lists the keys of a budget"
        raise first_fault(exc, BudgetFile, remedy) from None


Part = TypeVar("Part", bound=SensorPart | ConverterPart)


def _select(
    key: str, names: tuple[str, ...] | None, custom: list[Part], known: tuple[Part, ...]
) -> tuple[Part, ...]:
    """The parts of these names. Parts of the file replace known ones of the same name."""
    used: set[str] = set()
    for part in custom:
        if part.name in used:
            raise InputError(f"{key}.name", "unique", f"{part.name!r} twice", "rename one")
        used.add(part.name)
    if names is None:
        return tuple(custom) or known
    every = {part.name: part for part in (*known, *custom)}
    for name in names:
        if name not in every:
            must = f"of {', '.join(every)}"
            raise InputError(f"{key}s", must, repr(name[:40]), f"choose one, or add a [[{key}]]")
    return tuple(every[name] for name in dict.fromkeys(names))


def to_budget(file: BudgetFile) -> Budget:
    """The budget for the sweep. Raises InputError for more than MOST_ROWS choices."""
    budget = Budget(
        _select("sensor", file.sensors, [s.part() for s in file.sensor], SENSORS),
        _select("adc", file.adcs, [a.part() for a in file.adc], CONVERTERS),
        file.temperature, file.clock, file.circuit_noise, file.analog_gain, file.digital_gain,
        file.exposure, file.adc_rule, file.power, file.price, file.least_signal, file.ambient,
        file.cooler, Mapping(file.gamma, file.output_bits),
    )  # fmt: skip
    if budget.size > MOST_ROWS:
        raise InputError(
            "a budget", f"of at most {MOST_ROWS} choices", f"{budget.size}", "give shorter lists"
        )
    return budget
