"""The converter: every code, its steps, and what lies outside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensor.continuous.setting import Converter

KINDS = [(1, 0), (8, 0), (12, 0), (8, 3), (12, 5), (14, 5), (7, 6), (16, 6)]


@pytest.mark.parametrize(("bits", "exponent"), KINDS)
def test_every_code_comes_back(bits: int, exponent: int) -> None:
    converter = Converter(bits, exponent, 3e10)
    codes = np.arange(1 << bits, dtype=np.uint32)
    values = converter.decode(codes)
    np.testing.assert_array_equal(converter.encode(values), codes)
    assert (np.diff(values) > 0).all()
    assert values[0] == 0
    np.testing.assert_allclose(values[-1], 3e10, rtol=1e-15)


@pytest.mark.parametrize(("bits", "exponent"), KINDS)
def test_no_code_is_nearer(bits: int, exponent: int) -> None:
    converter = Converter(bits, exponent, 1e6)
    values = converter.decode(np.arange(1 << bits, dtype=np.uint32))
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(0, 1e6, 150), 10 ** rng.uniform(-9, 6, 150)])
    near = np.abs(values - x[:, None]).min(axis=1)
    error = np.abs(converter.decode(converter.encode(x)) - x)
    np.testing.assert_allclose(error, near, rtol=1e-6, atol=1e-9 * converter.unit)
    most = np.maximum(converter.unit / 2, x * 2.0 ** -(converter.mantissa_bits + 1))
    assert exponent == 0 or (error <= most * (1 + 1e-12)).all()


def test_known_codes() -> None:
    linear, floating = Converter(8, 0, 255.0), Converter(8, 3, 63.0 * 2**6)
    np.testing.assert_array_equal(
        linear.encode(np.array([-3.0, 0.49, 0.51, 128.0, 255.0, 1e9, np.inf])),
        [0, 0, 1, 128, 255, 255, 255],
    )
    assert linear.unit == floating.unit == 1
    # 5 mantissa bits: whole units to 63, then steps of 2 to 126, of 4 to 252, ...
    np.testing.assert_array_equal(
        floating.encode(np.array([31.0, 32.0, 63.0, 64.0, 66.0, 126.9, 127.1, 4032.0])),
        [31, 32, 63, 64, 65, 95, 96, 255],
    )


@given(
    st.integers(1, 24), st.integers(0, 6), st.floats(1e-3, 1e12), st.floats(0, 1, allow_nan=False)
)
def test_the_error_is_half_a_step_at_most(bits: int, exponent: int, full: float, x: float) -> None:
    if exponent >= bits:
        with pytest.raises(ValueError, match="exponent bits"):
            Converter(bits, exponent, full)
        return
    converter, value = Converter(bits, exponent, full), x * full
    back = float(converter.decode(converter.encode(np.array([value])))[0])
    step = max(converter.unit, value * 2.0**-converter.mantissa_bits)
    assert abs(back - value) <= (step if exponent else converter.unit) / 2 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("values", "says"),
    [((0, 0, 1.0), "bits must"), ((25, 0, 1.0), "bits must"), ((8, -1, 1.0), "exponent"),
     ((8, 7, 1.0), "exponent"), ((8, 0, 0.0), "full scale"), ((8, 0, np.inf), "full scale")],
)  # fmt: skip
def test_refuses(values: tuple[int, int, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Converter(*values)
