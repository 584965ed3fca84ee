"""[sensor.circuit]: units, limits, and what must stand together."""

from __future__ import annotations

import math
import re

import pytest
from pydantic import ValidationError

from cosim import InputError
from cosim.config.units import KINDS, parse_quantity
from scenarios.assemble.schema.messages import validate
from sensor.circuit.circuit import CircuitSection


def test_every_key_is_read_in_si_units() -> None:
    section = CircuitSection(
        capacitance="12 fF", nonlinearity=0.1, leak="20 ms", gain=2e3, bandwidth="0.5 GHz",
        trip="600 mV", resistance="0.2 Mohm", reset_time="15 ns",
    )  # type: ignore[arg-type]  # fmt: skip
    made = section.circuit
    assert made.capacitance == pytest.approx(1.2e-14, rel=1e-15)
    assert (made.nonlinearity, made.leak, made.gain) == (0.1, 0.02, 2e3)
    assert (made.bandwidth, made.trip, made.resistance) == pytest.approx((5e8, 0.6, 2e5))
    assert made.reset_time == pytest.approx(1.5e-8, rel=1e-15)
    assert CircuitSection(capacitance="5 fF").circuit.leak == math.inf  # type: ignore[arg-type]
    again = CircuitSection.model_validate(section.model_dump(mode="json"))
    assert again == section


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("capacitance", "0 fF", "above 0"),
        ("trip", "1 A", "must be a voltage such as '0.5 V'"),
        ("trip", "0.5", "must be a voltage"),
        ("resistance", "10 V", "must be a resistance such as '10 kohm'"),
        ("resistance", "10 kohm", "reset_time must be above 0 where there is a resistance"),
        ("bandwidth", "0 Hz", "above 0 Hz"),
        ("leak", "0 s", "above 0 s"),
        ("gain", math.nan, "finite"),
    ],
)
def test_what_cannot_be_is_refused(key: str, value: object, says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        CircuitSection.model_validate({"capacitance": "10 fF"} | {key: value})


def test_volts_and_ohms_are_kinds_of_their_own() -> None:
    assert parse_quantity("600 mV", KINDS["voltage"]) == pytest.approx(0.6)
    assert parse_quantity("2 kohm", KINDS["resistance"]) == pytest.approx(2000)
    with pytest.raises(ValueError, match="must be a resistance"):
        parse_quantity("2 V", KINDS["resistance"])


def test_a_refusal_of_keys_together_names_the_key() -> None:
    data = {
        "title": "t", "duration": "1 ms", "scene": {"kind": "step", "illuminance": "700 lux"},
        "sensor": {"threshold": "1000 e", "circuit": {
            "capacitance": "5 fF", "resistance": "10 kohm"}},
    }  # fmt: skip
    with pytest.raises(InputError) as caught:
        validate(data)
    assert str(caught.value) == (
        "sensor.circuit.reset_time must be above 0 where there is a resistance, not 0; write "
        "--set sensor.circuit.reset_time='100 ns'"
    )


def test_the_least_leak_that_is_named_is_accepted() -> None:
    keys = {"capacitance": "5 fF", "gain": 12345, "bandwidth": "4.321 kHz", "trip": "1 V"}
    with pytest.raises(ValidationError) as caught:
        CircuitSection(**keys, leak="1 s")  # type: ignore[arg-type]
    least = re.search(
        r"at least (\S+ s), 4 time constants of the comparator, not 1 s", str(caught.value)
    )
    assert least is not None
    CircuitSection(**keys, leak=least[1])  # type: ignore[arg-type]
