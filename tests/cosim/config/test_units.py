"""Quantities as text: accepted and refused units of each kind, and round trips."""

from __future__ import annotations

import pint
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cosim.config import units
from cosim.config.units import KINDS, format_quantity, parse_quantity

finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_what_is_formatted_is_read_back_the_same(kind) -> None:
    @given(finite)
    @example(1e-7)
    @example(0.1 + 0.2)
    @example(5e-324)
    @example(1.7976931348623157e308)
    def same(value: float) -> None:
        assert parse_quantity(format_quantity(value, kind), kind) == value

    same()


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("time", "64 ms", 0.064),
        ("time", "25us", 25e-6),
        ("time", "25 µs", 25e-6),  # micro sign
        ("time", "25 μs", 25e-6),  # Greek mu
        ("time", "2 min", 120.0),
        ("time", "1 h", 3600.0),
        ("time", "  64 ms\n", 0.064),
        ("time", "64\N{NO-BREAK SPACE}ms", 0.064),
        ("frequency", "40 kHz", 40e3),
        ("frequency", "29.97 Hz", 29.97),
        ("frequency", "85e6 Hz", 85e6),
        ("frequency", "20 1/s", 20.0),
        ("frequency", "20 s^-1", 20.0),
        ("frequency", "20 / ms", None),
        ("frequency", "20 1/ms", 20e3),
        ("illuminance", "700 lux", 700.0),
        ("illuminance", "700 lx", 700.0),
        ("illuminance", "1.5 klux", 1500.0),
        ("illuminance", "3 mlx", 0.003),
        ("illuminance", "700 lm/m^2", 700.0),
        ("illuminance", "700 lm/m**2", 700.0),
        ("illuminance", "700 lm/m²", 700.0),
        ("illuminance", "700 lumen / meter ** 2", 700.0),
        ("illuminance", "0.7 mlm/mm^2", 700.0),
        ("luminance", "300 cd/m²", 300.0),
        ("luminance", "300 cd/m2", 300.0),
        ("illuminance", "0.7 mlm/mm2", 700.0),
        ("luminance", "0.3 kcd/m^2", 300.0),
        ("speed", "4000 px/s", 4000.0),
        ("speed", "4 px/ms", 4000.0),
        ("charge", "1000 e", 1000.0),
        ("charge", "30 ke", 30e3),
        ("charge", "1.602176634e-19 C", 1.0),
        ("length", "10 um", 10.0),
        ("length", "0.01 mm", 10.0),
        ("angle", "15 deg", 15.0),
        ("angle", "100 mrad", 5.729577951308232),
        ("pressure", "9 kPa", 9e3),
        ("pressure", "10 mbar", 1e3),
        ("pressure", "760 torr", 101_325.0),
        ("wavelength", "555 nm", 555.0),
        ("wavelength", "0.555 µm", 555.0),
        ("time", "-.5e-3 s", -0.0005),
    ],
)
def test_units_of_the_kind_are_read(kind: str, text: str, value: float | None) -> None:
    if value is None:
        with pytest.raises(ValueError, match="must be"):
            parse_quantity(text, KINDS[kind])
    else:
        # A conversion multiplies by a factor or two, each rounded once.
        assert parse_quantity(text, KINDS[kind]) == pytest.approx(value, rel=4 * 2.3e-16, abs=0)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("other", KINDS.values(), ids=KINDS)
def test_a_quantity_of_another_kind_is_refused(kind, other) -> None:
    if set(kind.accepted) & set(other.accepted):
        assert parse_quantity(other.example, kind) > 0
    else:
        with pytest.raises(ValueError, match="must be"):
            parse_quantity(other.example, kind)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("illuminance", "700 cd/m^2"),
        ("illuminance", "700 nit"),
        ("illuminance", "700 lm"),
        ("illuminance", "700 W/m^2"),
        ("illuminance", "7 phot"),
        ("frequency", "4 bit/s"),
        ("frequency", "4 kbit/s"),
        ("frequency", "4 baud"),
        ("frequency", "4 rad/s"),
        ("frequency", "4 rpm"),
        ("frequency", "40 lux"),
        ("length", "10 px"),
        ("length", "10 m^2"),
        ("time", "1 ms ms"),
        ("time", "10 px"),
        ("charge", "10 V"),
        ("charge", "10 A s"),
    ],
)
def test_units_that_only_look_alike_are_refused(kind: str, text: str) -> None:
    with pytest.raises(ValueError, match="must be") as refused:
        parse_quantity(text, KINDS[kind])
    assert str(refused.value) == f"must be {KINDS[kind]}, not {text!r}"


def test_the_text_of_an_error_says_what_must_be_and_what_was_given() -> None:
    with pytest.raises(ValueError, match="must") as refused:
        parse_quantity("40 lux", KINDS["frequency"])
    assert str(refused.value) == "must be a frequency such as '40 kHz', not '40 lux'"
    with pytest.raises(ValueError, match="must") as refused:
        parse_quantity("bright", KINDS["illuminance"])
    assert str(refused.value) == "must be an illuminance such as '700 lux', not 'bright'"


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "40", "4e4", "Hz", "kHz 40", "nan Hz", "inf Hz", "-inf Hz", "1e999 Hz",
        "1e308 GHz", "40 kHz 3", "40 kHz 3 Hz", "4 0 Hz", "40,5 Hz", "1_000 Hz", "0x10 Hz",
        "40 kkHz", "40 khz!", "40 Hz; 3", "40 Hz\n40 Hz", "40 Hz + 1 Hz", "40 (Hz)",
        "4" * 400 + " Hz", "40 Hz**2", "40 Hz^1^1", "40 1/1/Hz", "40 %", "40 ☃",
        "40 k\u200bHz", "\u0664\u0660 kHz", "\uff14\uff10 kHz", "40 \x00Hz", "40 __",
        "40 None", "40 Hz[0]", "40 Hz()", "40 .Hz", "40 Hz.real",
    ],
)  # fmt: skip
def test_text_that_is_no_quantity_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"^must be a frequency such as '40 kHz', not "):
        parse_quantity(text, KINDS["frequency"])


@pytest.mark.parametrize(
    "text",
    [
        "1 Hz*9**9**9**9",
        "1 9^9^9^9*Hz",
        "1 Hz⁹⁹⁹⁹⁹⁹⁹⁹⁹",
        "1 " + "(" * 10**5,
        "1 " + "Hz " * 10**5 + "!",
        "1" + " " * 10**5 + "!",
        "1 a" + " /" * 10**5,
        "9" * 10**6,
        "9" * 10**6 + " kHz",
        "1 " + "a" * 10**5,
    ],
    ids=range(10),
)
def test_text_that_would_keep_a_parser_busy_is_refused_at_once(text: str) -> None:
    with pytest.raises(ValueError, match="must be a frequency"):
        parse_quantity(text, KINDS["frequency"])


@given(
    st.text("mskHzluxegCbit µ²⁻·/*^()[]019.-+_%\u0664☃\u2028\x00", max_size=12),
    st.sampled_from(list(KINDS.values())),
)
def test_any_text_is_read_or_refused(text: str, kind) -> None:
    for candidate in (text, "1 " + text):
        try:
            assert isinstance(parse_quantity(candidate, kind), float)
        except ValueError as exc:
            assert str(exc).startswith(f"must be {kind}, not ")


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_values_are_those_of_pints_own_table(kind) -> None:
    full = pint.UnitRegistry()
    for unit in (*kind.accepted, kind.unit):
        for prefix in ("", "kilo", "m", "µ", "Gi"):
            if prefix and (
                unit not in kind.accepted or "/" in unit or full.Unit(unit) == full.degC
            ):
                continue
            text = f"3.3 {prefix}{unit}"
            assert parse_quantity(text, kind) == pytest.approx(
                full.Quantity(3.3, prefix + unit).to(kind.unit).magnitude, rel=1e-15
            )


COMMON = [
    (kind, unit)
    for kind in KINDS.values()
    for unit in (kind.unit, *units._COMMON.get(kind.unit, {}))
]


@pytest.mark.parametrize(("kind", "unit"), COMMON, ids=lambda each: getattr(each, "name", each))
def test_common_units_have_pints_own_factors_to_the_last_bit(kind, unit, monkeypatch) -> None:
    texts = [f"{number} {unit}" for number in ("1", "0.1", "-7", "64", "1.7e-5", "123456789.123")]
    read = [parse_quantity(text, kind) for text in texts]
    monkeypatch.setattr(units, "_factor", lambda text, kind: None)
    assert [value.hex() for value in read] == [parse_quantity(text, kind).hex() for text in texts]
