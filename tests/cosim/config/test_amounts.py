"""Text of figures with units."""

import pytest

from cosim.config.amounts import amount


@pytest.mark.parametrize(
    ("value", "unit", "digits", "expected"),
    [
        (4.272e9, "bit/s", 4, "4.272 Gbit/s"),
        (8e7, "bit/s", 3, "80 Mbit/s"),
        (999.9, "bit/s", 3, "1 kbit/s"),  # not 1e+03 bit/s
        (999.4, "bit/s", 3, "999 bit/s"),
        (0.0, "bit/s", 3, "0 bit/s"),
        (8.514e8, "pixel-cycles/s", 3, "851 Mpixel-cycles/s"),
        (0.004, "s", 4, "4 ms"),
        (0.002875, "s", 4, "2.875 ms"),
        (0.99996, "s", 4, "1 s"),
        (2.5e-5, "s", 3, "25 µs"),
        (64.0, "s", 4, "64 s"),
        (0.0, "s", 4, "0 s"),
        (0.2123, "1", 3, "0.212"),
        (34.29, "dB", 4, "34.29 dB"),
        (5200.0, "pixels", 4, "5200 pixels"),
        (85_897.0, "1", 4, "85,897"),
        (57_344, "1", 4, "57,344"),
        (85_897.4, "1", 4, "85,900"),
        (1e6, "lux", 4, "1,000,000 lux"),
        (1e5, "lux", 3, "100,000 lux"),
        (1e12, "1", 4, "1e+12"),
    ],
)
def test_amounts(value: float, unit: str, digits: int, expected: str) -> None:
    assert amount(value, unit, digits) == expected
