"""The spike camera's own dynamic range: every figure of sections 3.3.2 to 5.2 that is of it."""

from __future__ import annotations

import pytest

from sensor.dynamic_range.spike_camera import (
    interval_rsd,
    level_step,
    levels_for,
    longest_width,
    photons_per_second,
    spike_dynamic_range,
    threshold_for,
)


def test_printed_figures():
    assert spike_dynamic_range(1, 10e-9) == pytest.approx(160)
    assert spike_dynamic_range(10, 10e-9) == pytest.approx(180)
    assert spike_dynamic_range(10e-3, 10e-9, 100) == pytest.approx(160)
    assert levels_for(180, 1, 10e-9) == pytest.approx(10)
    # Section 4.5 prints 10 for 0.1 s as well; 10 would be 160 dB.
    assert levels_for(180, 0.1, 10e-9) == pytest.approx(100)
    assert spike_dynamic_range(0.1, 10e-9, 10) == pytest.approx(160)


def test_strong_light():
    photons = photons_per_second(1e5, 100)
    assert photons == pytest.approx(4.09e10, rel=1e-3)
    assert 100 / (0.7 * photons) == pytest.approx(3.5e-9, rel=3e-3)
    assert threshold_for(0.7 * photons, 10e-9) == pytest.approx(286.3, abs=0.1)
    assert threshold_for(0.7 * photons, 10e-9) / (0.7 * photons) == pytest.approx(1e-8)


def test_dark_current_sets_the_longest_width():
    # Q = 100 and 100 e/s, the paper's figures, are its one second.
    assert longest_width(100, 100) == 1
    assert spike_dynamic_range(longest_width(100, 100), 10e-9) == pytest.approx(160)


@pytest.mark.parametrize(("width", "step"), [(1, 1 / 2), (2, 1 / 6), (255, 1 / 65_280)])
def test_level_steps(width: int, step: float):
    assert level_step(width) == pytest.approx(step)
    assert level_step(width) == pytest.approx(1 / width - 1 / (width + 1))


def test_interval_spread():
    for threshold, percent in ((100, 10), (1000, 3.16), (10_000, 1)):
        assert 100 * interval_rsd(threshold) == pytest.approx(percent, abs=0.005)
