"""The schema of a hardware budget (a TOML file and --set): the choices and their limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, field_validator

from cosim import InputError
from cosim.config.quantity import Section, Temperature, Time
from cosim.config.toml import read_toml
from imagers.hardware_chain.section import (
    AdcTable,
    Electrons,
    Gain,
    PixelClock,
    Price,
    SensorTable,
    Volts,
    Watts,
)
from scenarios.assemble.schema.loading import assign
from scenarios.assemble.schema.messages import first_fault
from sensor.dynamic_range import (
    CONVERTERS,
    SENSORS,
    Budget,
    ConverterPart,
    Mapping,
    SensorPart,
)

MOST_ROWS = 20_000
"""Maximum number of choices of a budget."""


T = TypeVar("T")


def _several(value: object) -> object:
    return value if isinstance(value, list | tuple) else [value]


Many = Annotated[
    tuple[T, ...], BeforeValidator(_several), Field(min_length=1, max_length=MOST_ROWS)
]
"""One value or a list of them."""


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
    sensor: tuple[SensorTable, ...] = ()
    adc: tuple[AdcTable, ...] = ()
    temperature: Many[Temperature] = (-10.0, 25.0, 50.0)
    clock: Many[PixelClock] = (20e6,)
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
            data = read_toml(Path(path))
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
