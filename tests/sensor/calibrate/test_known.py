"""Parameters as text."""

from __future__ import annotations

import pytest

from sensor.calibrate.known import Parameter


@pytest.mark.parametrize(
    ("value", "ci", "unit", "text"),
    [
        (901.9, (829.7, 996.94), "e", "901.9 e, 829.7 to 996.9"),
        (0.02, (0.01, None), "1", "0.02, 0.01 to ?"),
        ("residual", (None, None), "1", "residual"),
        (None, (None, None), "Hz", ""),
        (None, (0.0, 7908.0), "1/s", "at most 7908/s"),
        (None, (232.7, None), "e", "at least 232.7 e"),
        (None, (0.1, 0.2), "1", "0.1 to 0.2"),
        (1.165e-6, (8.872e-7, 1.444e-6), "s", "1.165 µs, 887.2 ns to 1.444 µs"),
        (None, (0.0, 7.5e-5), "s", "at most 75 µs"),
    ],
)
def test_value_and_limits(value: float | str | None, ci: tuple, unit: str, text: str) -> None:
    assert Parameter("a", "b", value, ci, unit, value is not None, "why").text == text
