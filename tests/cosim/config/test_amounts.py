"""Text of numbers: counts, quantities with units, shares, levels, times."""

import math

import pytest

from cosim.config.amounts import (
    THIN,
    amount,
    at_least,
    at_most,
    count,
    decibel,
    elapsed,
    number,
    percent,
)


@pytest.mark.parametrize(
    ("value", "unit", "digits", "expected"),
    [
        (4.272e9, "bit/s", 4, "4.272 Gbit/s"),
        (8e7, "bit/s", 3, "80 Mbit/s"),
        (999.9, "bit/s", 3, "1 kbit/s"),  # not 1e+03 bit/s
        (999.4, "bit/s", 3, "999 bit/s"),
        (0.0, "bit/s", 3, "0 bit/s"),
        (12_345.0, "B/s", 3, "12.3 kB/s"),
        (8.514e8, "pixel-cycles/s", 3, "851 Mpixel-cycles/s"),
        (0.004, "s", 4, "4 ms"),
        (0.002875, "s", 4, "2.875 ms"),
        (0.99996, "s", 4, "1 s"),
        (2.5e-5, "s", 3, "25 µs"),
        (64.0, "s", 4, "64 s"),
        (2250.0, "s", 3, "2250 s"),  # not 2.25e+03 s
        (2251.3, "s", 3, "2250 s"),
        (0.0, "s", 4, "0 s"),
        (0.2123, "1", 3, "0.212"),
        (34.29, "dB", 4, "34.29 dB"),
        (5200.0, "pixels", 4, "5200 pixels"),
        (85_897.0, "1", 4, "85_897"),
        (57_344, "1", 4, "57_344"),
        (85_897.4, "1", 4, "85_900"),
        (1e6, "lux", 4, "1_000_000 lux"),
        (1e5, "lux", 3, "100_000 lux"),
        (1e12, "1", 4, "1 × 10¹²"),
        (12.34, "us", 3, "12.3 µs"),
        (12.34, "1/s", 3, "12.3/s"),
        (None, "s", 3, "unknown"),
        (math.nan, "bit/s", 3, "unknown"),
    ],
)
def test_amounts(value: float, unit: str, digits: int, expected: str) -> None:
    assert amount(value, unit, digits) == expected.replace("_", THIN)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (19_209, "19_209"),
        (9_999, "9999"),
        (10_000.0, "10_000"),
        (-1_234_567, "-1_234_567"),
        (0, "0"),
        (None, "unknown"),
    ],
)
def test_a_count_is_whole(value, expected):
    assert count(value) == expected.replace("_", THIN)


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (0.0, 3, "0"),
        (-0.0, 3, "0"),
        (19_209.0, 3, "19_209"),  # a whole number stays whole
        (19_209.4, 3, "19_200"),
        (0.5, 3, "0.5"),
        (0.049951, 3, "0.05"),
        (0.00012345, 3, "0.000123"),
        (0.000099999, 3, "0.0001"),  # rounded before the power is chosen
        (0.0000999, 3, "9.99 × 10⁻⁵"),
        (1.2e-5, 3, "1.2 × 10⁻⁵"),
        (-1.234e-7, 2, "-1.2 × 10⁻⁷"),
        (999_999.5, 3, "1 × 10⁶"),
        (123_456.7, 3, "123_000"),
        (4.567895e8 + 0.5, 3, "4.57 × 10⁸"),
        (math.inf, 3, "∞"),
        (-math.inf, 3, "-∞"),
        (math.nan, 3, "unknown"),
        (None, 3, "unknown"),
    ],
)
def test_numbers(value, digits, expected):
    assert number(value, digits) == expected.replace("_", THIN)


@pytest.mark.parametrize("value", [3.14159e-9, 0.0271828, 1.41421, 57.2958, 65_432.1, 6.022e23])
@pytest.mark.parametrize("digits", [1, 2, 3, 6])
def test_the_text_of_a_number_is_its_rounded_value(value, digits):
    text = number(value, digits).replace(THIN, "")
    mantissa, _, power = text.partition(" × 10")
    back = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    read = float(mantissa) * 10.0 ** int(power.translate(back) or 0)
    assert read == pytest.approx(float(f"{value:.{digits}g}"), rel=1e-12)


def test_a_sign_can_be_asked_for():
    assert number(1.5, sign=True) == "+1.5"
    assert number(12_345, sign=True) == f"+12{THIN}345"
    assert percent(0.0123, sign=True) == "+1.23 %"


@pytest.mark.parametrize(
    ("share", "expected"),
    [
        (0.1234, "12.3 %"),
        (1.0, "100 %"),
        (0.99999, "over 99.9 %"),  # not all of it
        (0.0, "0 %"),
        (1e-7, "1 × 10⁻⁵ %"),
        (math.nan, "unknown"),
    ],
)
def test_shares(share, expected):
    assert percent(share) == expected


def test_a_ratio_that_is_rounding_alone_is_not_printed_as_one():
    assert decibel(34.26) == "34.3 dB"
    assert decibel(193.2) == "over 100 dB"
    assert decibel(math.inf) == "exact"
    assert decibel(None) == decibel(math.nan) == "unknown"


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        (0.0123, "12.3 ms"),
        (12.34, "12.3 s"),
        (99.94, "99.9 s"),
        (99.96, "1 min 40 s"),
        (2250, "37 min 30 s"),
        (3599.6, "1 h"),
        (7500, "2 h 5 min"),
        (273_600, "3 d 4 h"),
        (172_799, "2 d"),
        (None, "unknown"),
        (math.inf, "unknown"),
    ],
)
def test_times_that_people_wait(seconds, expected):
    assert elapsed(seconds) == expected


@pytest.mark.parametrize(
    ("value", "least", "most"),
    [
        (2331.5, "2340", "2330"), (93.0512, "93.1", "93"), (1 / 3e7, "3.34e-08", "3.33e-08"),
        (0.1 + 0.2, "0.3", "0.3"), (373456, "374000", "373000"), (0.0, "0", "0"),
        (math.inf, "inf", "inf"),
    ],
)  # fmt: skip
def test_a_limit_is_rounded_to_the_side_that_is_accepted(value, least, most):
    assert (at_least(value, 3), at_most(value, 3)) == (least, most)
