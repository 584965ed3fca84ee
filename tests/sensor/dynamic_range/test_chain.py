"""Dynamic range of a chain: the printed figures, the derived formula against drawn values, and how
the document's formula differs from it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from sensor.dynamic_range.chain import (
    DALSA,
    Chain,
    FullWell,
    Mapping,
    document_dynamic_range,
    gain_counted_once,
    rounding_variance,
)
from sensor.dynamic_range.monte_carlo import chain_values, measure_chain
from sensor.dynamic_range.parts import (
    BOLTZMANN_EV,
    CONVERTERS,
    KODAK,
    SENSORS,
    Converter,
    DarkLaw,
    SensorNoise,
    bits_for,
    converter_rule,
    decibels,
    sensor_dynamic_range,
)

FAR = float(norm.isf(0.5e-6))


def test_the_documents_example():
    noise = KODAK.noise.at(25, 27e6)
    assert noise == 25
    assert sensor_dynamic_range(KODAK.full_well, noise) == pytest.approx(64.08, abs=0.005)


def test_the_reset_noise_of_a_3t_pixel_is_that_of_its_capacitance():
    """10 fF at 25 degC: sqrt(k T C)/q is 40 e; reset after reading doubles the variance."""
    part = next(sensor for sensor in SENSORS if sensor.name == "cmos-3t")
    assert part.noise.reset == pytest.approx(
        math.sqrt(2 * 1.380649e-23 * 298.15 * 10e-15) / 1.602176634e-19
    )
    assert round(part.noise.reset / math.sqrt(2)) == 40


def test_each_noise_follows_its_law():
    noise = SensorNoise(4, 3, 2, DarkLaw(10, doubling=7), 25, 20e6)
    parts = noise.parts(25 + 298.15, 80e6, 2, 81)
    assert parts["reset"] == pytest.approx(4 * math.sqrt(2))
    assert parts["white"] == pytest.approx(3 * math.sqrt(2))
    assert parts["transfer"] == pytest.approx(4)
    assert parts["shot"] == 9
    assert noise.parts(32, 20e6, 2)["dark"] == pytest.approx(math.sqrt(2 * 10 * 2))
    assert noise.at(25, 20e6, 5, 20) == pytest.approx(math.sqrt(16 + 9 + 4 + 50 + 20))


def test_an_activated_dark_current_is_the_ccd97s():
    """1.14e6 T^3 exp(-9080/T) of 400 e/s at 293 K: 33.5, 8.5 and 1.93 e/s at 0, -10 and -20."""
    law = DarkLaw(400, 293 - 273.15, activation=9080 * BOLTZMANN_EV)
    for celsius, printed in ((0, 33.5), (-10, 8.5), (-20, 1.93)):
        kelvin = celsius + 273.15
        print_form = 400 * 1.14e6 * kelvin**3 * math.exp(-9080 / kelvin)
        # The constant is given to three digits.
        assert law.at(celsius) == pytest.approx(print_form, rel=0.01)
        assert law.at(celsius) == pytest.approx(printed, rel=0.02)
    # Steeper than reset and white noise anywhere: the point of the document.
    assert law.at(30) / law.at(20) > 2.5


@pytest.mark.parametrize("digital", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("analog", [1.0, 2.5, 6.0])
def test_drawn_values_have_the_derived_range(analog: float, digital: float):
    chain = Chain(40_000, 25, 25e-6, 1e-4, Converter(12, 2, 174e-6), analog, digital)
    assert chain.dithered
    found = measure_chain(chain, 20_000, seed=3, deviations=FAR)
    assert found.low < chain.derived < found.high
    assert found.high - found.low < 0.7  # so it would see a gain counted twice, or noises added
    assert found.saturation == pytest.approx(chain.saturation, rel=2e-3)


def test_what_limits_a_chain_is_named_and_drawn():
    sensor = Chain(40_000, 25, 25e-6, 0, Converter(14, 2), 1.5, 1)
    word = Chain(40_000, 25, 25e-6, 0, Converter(14, 2), 1, 4)
    converter = Chain(40_000, 25, 25e-6, 0, Converter(14, 2), 4, 1)
    assert [c.limit for c in (sensor, word, converter)] == ["sensor", "output word", "converter"]
    assert sensor.saturation == 40_000
    assert word.saturation == converter.saturation == pytest.approx(20_000)
    top = chain_values(word, 80_000, 100, 1, 0)
    assert (top == 2**14 - 1).all()


gains = st.floats(1, 16)
amounts = st.floats(1e-6, 1e-2)


@given(analog=gains, digital=gains, noise=amounts, circuit=amounts, alpha=st.floats(0, 4))
def test_the_document_counts_the_gain_twice(analog, digital, noise, circuit, alpha):
    """Against one plane of reference it is 20 log10(n m) too low, and right at m = n = 1."""
    args = (1.0, 1.0, noise, circuit, analog, digital, alpha)
    gap = gain_counted_once(*args) - document_dynamic_range(*args)
    assert gap == pytest.approx(decibels(digital * analog), abs=1e-9)
    plain = (1.0, 1.0, noise, circuit, 1.0, 1.0, 0.0)
    assert document_dynamic_range(*plain) == pytest.approx(decibels(1 / (noise + circuit)))


@given(analog=gains, noise=amounts, circuit=amounts)
def test_the_formula_counted_once_is_the_derived_one(analog, noise, circuit):
    """Up to shot noise and noises that add in quadrature: at most a factor of sqrt(3) of three."""
    converter = Converter(16, 1.0, noise / 3)
    chain = Chain(1.0, noise, 1.0, circuit, converter, analog, 1.0)
    alpha = converter.total_noise / (noise + circuit)
    once = gain_counted_once(1.0, 1.0, noise, circuit, analog, 1.0, alpha)
    assert -1e-9 <= chain.over_noise - once <= decibels(math.sqrt(3)) + 1e-9


@pytest.mark.parametrize("digital", [1.0, 0.5, 1.5, 2.25, 1.1, 3.0, 10.0])
def test_rounding_after_a_digital_gain(digital: float):
    codes = np.arange(2000)  # whole periods
    exact = codes * digital
    # Doubles of 1.1 k may end a hair below a half: rounded as decimals are.
    error = np.floor(np.round(exact, 9) + 0.5) - exact
    assert rounding_variance(digital) == pytest.approx(error.var(), abs=1e-12)


def test_a_converter_by_its_own_noise():
    converter = Converter(12, 2.0, 174e-6)
    # Signal-to-noise ratio of a sine of full scale, 70 dB: amplitude 1 V over sqrt 2.
    assert decibels(1 / math.sqrt(2) / converter.total_noise) == pytest.approx(70, abs=0.03)
    ideal = Converter(12, 1.0)
    # 6.02 dB a bit and sqrt(12).
    assert ideal.dynamic_range == pytest.approx(decibels(4095) + 10.79, abs=0.01)


def test_twice_the_sensors_range_by_both_readings():
    rule = converter_rule(sensor_dynamic_range(40_000, 25), Converter(12, 1.0))
    assert rule.as_ratio == pytest.approx(decibels(3200))
    assert rule.as_decibels == pytest.approx(2 * 64.0824, abs=1e-4)
    assert (bits_for(rule.as_ratio), bits_for(rule.as_decibels)) == (10, 20)
    assert (bits_for(rule.as_ratio, "steps"), bits_for(rule.as_decibels, "steps")) == (12, 22)
    assert rule.holds and not rule.holds_in_decibels
    # A converter of half the sensor's noise costs 0.97 dB.
    chain = Chain(40_000, 25, 1.0, 0, Converter(30, 40_000, 12.5))
    assert decibels(40_000 / 25) - chain.over_noise == pytest.approx(rule.loss, abs=1e-6)
    assert all(bits_for(Converter(b, 1).dynamic_range - 1e-3) == b for b in range(4, 20))


def test_a_mapping_holds_gamma_times_its_steps():
    linear, curved = Mapping(1.0), Mapping(2.2)
    assert linear.holds == pytest.approx(48.13, abs=0.005)
    assert curved.holds == pytest.approx(105.89, abs=0.005)
    assert (linear.survives(64.08), curved.survives(64.08)) == (linear.holds, 64.08)
    for mapping in (linear, curved, Mapping(1.4, 10)):
        least = 10 ** (-mapping.holds / 20)
        assert mapping.codes(least) == 1
        # Half of the first step's light, where the curve is steep, is still no step lower.
        assert mapping.codes(least * 0.5**mapping.gamma * 0.999) == 0
        assert mapping.codes([0, 1, 2]).tolist() == [0, mapping.steps, mapping.steps]
        codes = np.arange(mapping.steps + 1)
        assert (mapping.codes(mapping.light(codes)) == codes).all()
        # The relative step in the middle of the scale, against neighbouring codes.
        middle = mapping.steps // 2
        a, b = mapping.light([middle, middle + 1])
        assert (b - a) / a == pytest.approx(mapping.step(a), rel=2 / middle)


def test_beyond_the_linear_full_well():
    # 3400 mV over 2500 mV, the document's figures.
    assert DALSA.output_gain == pytest.approx(2.67, abs=0.005)
    light = np.linspace(0, 20, 20_001)
    volts = DALSA.response(light)
    assert volts[light <= 2.5] == pytest.approx(light[light <= 2.5])
    assert volts.max() < 3.4 and volts[-1] == pytest.approx(3.4)
    slopes = np.diff(volts) / np.diff(light)
    assert (np.diff(slopes) < 1e-9).all()
    reach = 2.5 + (3.4 - 2.5) * math.log(10)  # where a tenth of the slope is left
    assert slopes[np.searchsorted(light, reach)] == pytest.approx(0.1, rel=2e-3)
    assert FullWell(2.5, 2.5).response(9.0) == 2.5


def test_parts_that_ship_say_where_from():
    for part in CONVERTERS:
        assert part.source and part.converter.total_noise > 0
