"""The light flickermeter against closed forms, and against points of the IEC flickermeter."""

import numpy as np
import pytest
from scipy import signal

from display.quality.pstlm import (
    HIGH_PASS,
    LEAST_SECONDS,
    LEVELS,
    LOW_PASS,
    SCALE,
    SMOOTHING,
    WEIGHTING,
    pst_lm,
)

RATE = 1000
TIME = np.arange(120 * RATE) / RATE
LAMP = (2 * np.pi * 7.87453796, 2 * np.pi * 160.831771)
"""Poles, rad/s, of the 230 V lamp that H(s) has taken out of the flickermeter's weighting: H's
zeros beside the one that both share."""


def weight(hz):
    s = 2j * np.pi * hz
    return np.polyval(WEIGHTING[0], s) / np.polyval(WEIGHTING[1], s)


@pytest.mark.parametrize("hz", [2.0, 8.8, 20.0])
def test_a_sine_has_the_closed_form(hz):
    # sin² is a mean and a ripple at twice the frequency; exceeded in p % is mean + ripple cos(pi p)
    low = 1 / np.sqrt(1 + (hz / LOW_PASS) ** 12)
    high = 1 / np.sqrt(1 + (HIGH_PASS / hz) ** 2)
    mean = SCALE * (0.01 * abs(weight(hz)) * low * high) ** 2 / 2
    ripple = mean / np.sqrt(1 + (2 * np.pi * 2 * hz * SMOOTHING) ** 2)
    total = 0.0
    for share, percents in LEVELS:
        level = mean + ripple * np.cos(np.pi * np.array(percents) / 100)
        total += share * level.mean()
    wave = 1 + 0.01 * np.sin(2 * np.pi * hz * TIME)
    assert pst_lm(wave, RATE) == pytest.approx(np.sqrt(total), rel=3e-3)


def test_steady_light_is_0_and_depth_counts_in_proportion():
    assert pst_lm(np.full(len(TIME), 0.18), RATE) < 1e-9
    rng = np.random.default_rng(1)
    noise = rng.uniform(-1, 1, len(TIME))
    one, ten = (pst_lm(1 + depth * noise, RATE) for depth in (0.01, 0.1))
    # The mean, which is divided by, is itself of noise.
    assert ten == pytest.approx(10 * one, rel=6 * 0.1 / np.sqrt(3 * len(TIME)))


def test_the_rate_does_not_matter():
    time = np.arange(70 * 8000) / 8000
    fine = 1 + 0.02 * np.sin(2 * np.pi * 8.8 * time)
    assert pst_lm(fine[::20], 400) == pytest.approx(pst_lm(fine, 8000), rel=2e-3)


@pytest.mark.parametrize(
    ("changes", "percent"), [(7, 1.459), (39, 0.894), (110, 0.722), (1620, 0.407)]
)
def test_points_of_the_iec_flickermeter(changes, percent):
    """Rectangular changes of 230 V that have Pst 1 (IEC 61000-4-15, its performance test, within
    5 %), through the lamp. The lamp's gain is the one that makes the sensation of a sine of 0.25 %
    peak to peak at 8.8 Hz just 1, at its peak."""
    rate, length = 500, 320
    s = 2j * np.pi * 8.8
    a, b = LAMP
    ripple = 1 / np.hypot(1, 4 * np.pi * 8.8 * SMOOTHING)
    seen = abs(weight(8.8) / ((1 + s / a) * (1 + s / b)))
    gain = np.sqrt(2 / SCALE / (1 + ripple)) / (0.0025 / 2 * seen)
    assert 3 < gain < 4  # light of a filament goes with a power of its voltage
    turn = np.arange(length * rate) * changes % (120 * rate)
    volts = percent / 100 / 2 * np.where(turn < 60 * rate, 1, -1)
    lamp = signal.zpk2sos(*signal.bilinear_zpk([], [-a, -b], a * b, rate))
    assert pst_lm(1 + gain * signal.sosfilt(lamp, volts), rate) == pytest.approx(1, abs=0.05)


def test_what_is_too_short_or_too_coarse_is_refused():
    assert 60 < LEAST_SECONDS < 65
    for seconds, rate in ((60, 1000), (120, 300)):
        with pytest.raises(ValueError, match=f"PstLM needs .* not {seconds} s at {rate} Hz"):
            pst_lm(np.ones(seconds * rate), rate)
