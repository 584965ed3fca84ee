"""Flicker, SVM and visibility of waveforms whose textbook values are known."""

import numpy as np
import pytest
from scipy.optimize import brentq

from display.quality.flicker import (
    flicker_index,
    ieee_1789_of,
    percent_flicker,
    risk_of,
    sensitivity,
    spectrum,
    svm,
    svm_threshold,
    tcsf_visibility_of,
)

RATE = 20_000
SAMPLE = np.arange(2 * RATE)


def critical_frequency(contrast, luminance, field):
    """Frequency, Hz, above which a sine of this contrast is not visible."""
    return brentq(lambda f: contrast * sensitivity(f, luminance, field)[0] - 1, 10.0, 500.0)


def visibility(wave, luminance, field):
    """Flicker of samples of light over its threshold."""
    return tcsf_visibility_of(spectrum(wave, RATE), luminance, field)


def square(hz, duty=0.5):
    """Pulses of a rate that divides RATE, on for `duty`."""
    period = RATE // hz
    return (SAMPLE % period < period * duty).astype(float)


def sine(hz, depth=1.0):
    return 1 + depth * np.sin(2 * np.pi * hz * SAMPLE / RATE)


@pytest.mark.parametrize(
    ("wave", "percent", "index"),
    [
        (square(100), 100, 0.5),
        (square(100, 0.25), 100, 0.75),
        (sine(120), 100, 1 / np.pi),
        (sine(100, 0.3), 30, 0.3 / np.pi),
        (3 + square(50), 100 / 7, 0.5 * 0.5 / 3.5),
        (np.full(2 * RATE, 0.18), 0, 0),
        ((SAMPLE % 200) / 200, 100, 0.25),  # sawtooth
    ],
)
def test_percent_flicker_and_index(wave, percent, index):
    assert percent_flicker(wave) == pytest.approx(percent, abs=0.02)
    assert flicker_index(wave) == pytest.approx(index, abs=2e-3)


@pytest.mark.parametrize(
    ("wave", "hz", "percent", "risk"),
    [
        (square(100), 100, 400 / np.pi, "high risk"),
        (sine(120), 120, 100, "high risk"),
        (sine(120, 0.09), 120, 9, "low risk"),  # limits 3.996 and 9.6 %
        (sine(120, 0.0390), 120, 3.9, "no effect"),
        (sine(60, 0.01), 60, 1, "low risk"),  # 0.6 and 1.5 %
        (sine(2000), 2000, 100, "low risk"),  # no effect to 66.6 %
        (sine(4000), 4000, 100, "no effect"),  # exempt
    ],
)
def test_ieee_1789(wave, hz, percent, risk):
    found = ieee_1789_of(spectrum(wave, RATE))
    assert found.frequency == pytest.approx(hz, abs=1)
    assert found.modulation == pytest.approx(percent, rel=1e-3)
    assert found.risk == risk


def test_limits_stand_on_both_sides_of_90_hz():
    assert (risk_of(89.9, 1).no_effect, risk_of(89.9, 1).low_risk) == pytest.approx((0.899, 2.2475))
    assert (risk_of(90, 1).no_effect, risk_of(90, 1).low_risk) == pytest.approx((2.997, 7.2))
    assert risk_of(1249, 99).risk == "low risk" and risk_of(1249, 100).risk == "high risk"


@pytest.mark.parametrize("hz", [100, 120.37, 333.5, 1999])
@pytest.mark.parametrize("depth", [0.1, 1.0])
def test_svm_of_a_sine_is_its_contrast_over_the_threshold(hz, depth):
    # Wherever it falls between bins: a bin alone would lose up to 15 %, and gain in the sum.
    assert svm(sine(hz, depth), RATE) == pytest.approx(depth / float(svm_threshold(hz)), rel=3e-3)


def test_svm_of_a_square_is_the_sum_over_its_harmonics():
    odd = np.arange(1, 21, 2)
    lines = 4 / np.pi / odd / svm_threshold(100 * odd)
    assert svm(square(100), RATE) == pytest.approx((lines**3.7).sum() ** (1 / 3.7), rel=1e-3)


def test_svm_counts_from_80_to_2000_hz():
    assert svm(np.ones(RATE), RATE) == 0
    assert svm(sine(60), RATE) < 1e-3 and svm(sine(2100), RATE) < 1e-3
    assert float(svm_threshold(100)) == pytest.approx(0.2563, abs=1e-4)


@pytest.mark.parametrize(("seconds", "rate"), [(0.9, 20_000), (2, 3900)])
def test_svm_refuses_what_is_too_short_or_too_coarse(seconds, rate):
    with pytest.raises(ValueError, match=rf"SVM needs at least 1 s .* not {seconds:g} s at {rate}"):
        svm(np.ones(int(seconds * rate)), rate)


def test_energy_is_that_of_the_waveform():
    rng = np.random.default_rng(2)
    noise = 1 + 0.05 * rng.standard_normal(20 * RATE)  # variance .0025: contrast² is twice that
    energy = spectrum(noise, RATE).energy.sum()
    assert energy == pytest.approx(0.005, rel=6 * np.sqrt(2 / noise.size) * 1.5)


@pytest.mark.parametrize(
    ("peak", "hz"), [(10, 45.1508), (88.5867, 65.3153), (1128.838, 84.5875), (10_000, 100.1625)]
)
def test_critical_frequencies_of_elatcsf(peak, hz):
    # Of its authors' table: contrast 0.1 over 110 x 96 degrees; their grid is good to 4 digits.
    assert critical_frequency(0.1, 0.1 * peak, (110, 96)) == pytest.approx(hz, abs=6e-4)


def test_a_critical_frequency_of_numpy_numbers():
    field = tuple(np.array([110.0, 96.0]))
    assert critical_frequency(np.float64(0.1), np.float64(1.0), field) == critical_frequency(
        0.1, 1.0, (110, 96)
    )


def test_visibility_of_a_sine_is_contrast_times_sensitivity():
    for hz in (10, 30.4, 60):
        wanted = 0.2 * sensitivity(hz, 300, (16.7, 16.7))[0]
        assert visibility(sine(hz, 0.2), 300, (16.7, 16.7)) == pytest.approx(wanted, rel=2e-2)
    edge = critical_frequency(0.5, 100, (20, 20))
    at_edge = np.array([visibility(sine(edge + d, 0.5), 100, (20, 20)) for d in (-2, 2)])
    assert at_edge[0] > 1 > at_edge[1]


def test_visibility_adds_up_as_energy_and_not_with_time():
    field = (10.0, 10.0)
    two = 1 + 0.1 * (sine(20) - 1) + 0.1 * (sine(30) - 1)
    alone = [visibility(sine(hz, 0.1), 100, field) for hz in (20, 30)]
    assert visibility(two, 100, field) == pytest.approx(np.hypot(*alone), rel=1e-6)
    rng = np.random.default_rng(3)
    noise = np.maximum(1 + 0.1 * rng.standard_normal(40 * RATE), 0)
    short, long = (visibility(noise[:n], 100, field) for n in (4 * RATE, 40 * RATE))
    # Of about 80 visible bins a second: 6 deviations of the shorter one's energy.
    assert short == pytest.approx(long, rel=6 / np.sqrt(2 * 80 * 4))


@pytest.mark.parametrize(
    ("wave", "says"),
    [
        ([1.0] * 15, "16 or more"),
        ([-1.0] * 20, "must be light"),
        ([0.0] * 20, "not always 0"),
        ([float("nan")] * 20, "finite"),
    ],
)
def test_what_is_no_light_is_refused(wave, says):
    with pytest.raises(ValueError, match=says):
        percent_flicker(wave)
