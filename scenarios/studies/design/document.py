"""A hardware budget and its document: the schema of a budget (a TOML file and --set), with the
choices and their limits, and the ranked choices of `viform design dynamic-range --json`."""

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
    Judged,
    Mapping,
    SensorPart,
    bits_for,
    measure_chain,
    sweep,
)

MOST_ROWS = 20_000
"""Maximum number of choices of a budget."""
T = TypeVar("T")
Part = TypeVar("Part", bound=SensorPart | ConverterPart)
UNITS = {
    "temperature": "degC", "clock": "Hz", "circuit_noise": "V", "analog_gain": "1",
    "digital_gain": "1", "dr_db": "dB", "dr_over_noise_db": "dB", "dr_document_db": "dB",
    "dr_output_db": "dB", "sensor_db": "dB", "saturation": "e", "least_signal": "e", "noise": "e",
    "power": "W",
}  # fmt: skip
"""Units of the figures in a row."""


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


def _row(one: Judged, used: str) -> dict[str, Any]:
    choice, chain = one.choice, one.chain
    notes = list(one.faults)
    if not chain.dithered:
        notes.append("the converter step exceeds the noise: the range is nominal")
    return {
        "sensor": choice.sensor.name, "adc": choice.converter.name,
        "temperature": choice.celsius, "clock": choice.hertz, "circuit_noise": choice.circuit,
        "analog_gain": choice.analog, "digital_gain": choice.digital,
        "dr_db": chain.derived, "dr_over_noise_db": chain.over_noise,
        "dr_document_db": chain.document, "dr_output_db": one.mapped, "sensor_db": one.rule.sensor,
        "saturation": chain.saturation, "limited_by": chain.limit, "least_signal": chain.least,
        "noise": chain.parts(),
        "adc_rule": {
            "adc_db": one.rule.converter, "ratio_db": one.rule.as_ratio,
            "decibels_db": one.rule.as_decibels, "ratio_holds": one.rule.holds,
            "decibels_holds": one.rule.holds_in_decibels, "used": used,
        },
        "power": one.watts, "price": one.price, "allowed": not one.faults,
        "note": "; ".join(notes),
    }  # fmt: skip


def _ruled_out(
    rows: list[dict[str, Any]], judged: list[Judged], best: dict[str, Any] | None
) -> dict[str, Any] | None:
    """The row `best_without_rule` of `budget_document`."""
    only = [
        row for row, one in zip(rows, judged, strict=True)
        if len(one.faults) == 1 and one.faults[0].startswith("converter rule")
    ]  # fmt: skip
    first = max(only, key=lambda row: row["dr_db"], default=None)
    if first is None or (best is not None and first["dr_db"] <= best["dr_db"]):
        return None
    return first


def budget_document(
    title: str, budget: Budget, *, measure: bool = False, seed: int = 1
) -> dict[str, Any]:
    """Evaluates every choice of a budget.

    Args:
        title: title of the budget.
        budget: choices and limits.
        measure: whether the best choice is simulated; its row then has `measured` {db, ci} with
            limits of 99 % confidence.
        seed: seed of the simulation.

    Returns:
        {title, rows, best, best_without_rule, constraints, swept, parts, units}. `rows` holds every
        choice, the best first. `best` is the first row within all limits, or None.
        `best_without_rule` is the best row that only the converter rule excludes, if it is better
        than `best`, else None: the derived range includes the noise of the converter and needs no
        such rule.
    """
    judged = sweep(budget)
    rows = [_row(one, budget.rule) for one in judged]
    best = dict(rows[0]) if rows and rows[0]["allowed"] else None
    if best is not None:
        sensor = best["sensor_db"]
        best["adc_bits_by_rule"] = None if sensor == float("inf") else {
            "ratio": bits_for(judged[0].rule.as_ratio),
            "decibels": bits_for(judged[0].rule.as_decibels),
        }  # fmt: skip
        if measure:
            measured = measure_chain(judged[0].chain, seed=seed)
            best["measured"] = {"db": measured.db, "ci": [measured.low, measured.high]}
    return {
        "title": title, "rows": rows, "best": best,
        "best_without_rule": _ruled_out(rows, judged, best),
        "constraints": {
            "adc_rule": budget.rule, "power": budget.watts, "price": budget.price,
            "least_signal": budget.least, "exposure_s": budget.seconds,
            "ambient": budget.ambient, "cooler_w_per_k": budget.watts_per_kelvin,
            "gamma": budget.mapping.gamma, "output_bits": budget.mapping.bits,
            "output_holds_db": budget.mapping.holds,
            "allowed": sum(row["allowed"] for row in rows),
        },
        "swept": {
            "sensor": [p.name for p in budget.sensors], "adc": [p.name for p in budget.converters],
            "temperature": list(budget.temperatures), "clock": list(budget.clocks),
            "circuit_noise": list(budget.circuits), "analog_gain": list(budget.analogs),
            "digital_gain": list(budget.digitals),
        },
        "parts": {p.name: p.source for p in budget.sensors}
        | {p.name: p.source for p in budget.converters},
        "units": UNITS,
    }  # fmt: skip
