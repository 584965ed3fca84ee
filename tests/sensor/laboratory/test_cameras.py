"""The laboratory finds what a spike camera is set to, from counts of its spikes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from cosim.light.radiometry import photons_per_lux
from sensor.device.pattern import DevicePattern
from sensor.frame_pixels import Exposed
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import SPIKE_CAMERAS, SpikeCounter, silicon_setting
from sensor.laboratory.emva import measure_camera

SHAPE, SECONDS, THRESHOLD = (16, 64), 0.01, 100.0
FAR = norm.isf(0.5e-6) / norm.isf(0.005)


def expose(pixels: SpikeCounter, electrons: float, frames: int) -> np.ndarray:
    """Counts under light of so many electrons an exposure, (frames, H, W)."""
    per_lux = pixels.setting.electrons_per_lux
    light, seconds = np.full(SHAPE, electrons / per_lux), np.full(SHAPE[0], SECONDS)
    every = frozenset(pixels.effects)
    return np.stack([
        pixels.convert(Exposed(light, seconds, 0 * seconds, 0, n), 7, every) for n in range(frames)
    ]).astype(float)  # fmt: skip


def test_a_count_is_the_number_of_electrons_over_the_threshold() -> None:
    """Of an ideal pixel: mean N/Q, variance N/Q^2 and 1/6 of both ends of the exposure."""
    setting = replace(silicon_setting("spikeone", SHAPE, THRESHOLD), pattern=None)
    ideal = ("residual carried", "random initial charge", "shot noise")
    setting = setting.without(
        [effect.name for effect in setting.acting_effects if effect.name not in ideal]
    )
    pixels = SpikeCounter(setting, SECONDS)
    assert pixels.bits == 9
    counts = expose(pixels, 20_050.0, 24)
    many = counts.size
    variance = 20_050 / THRESHOLD**2 + 1 / 6
    # 4.9 deviations are a chance of one in a million.
    assert counts.mean() == pytest.approx(200.5, abs=4.9 * math.sqrt(variance / many))
    assert counts.var() == pytest.approx(variance, rel=4.9 * math.sqrt(2 / many))
    # Frames share no noise: neither do neighbours.
    away = counts - counts.mean()
    assert abs((away[1:] * away[:-1]).mean()) < 4.9 * variance / math.sqrt(many)
    assert expose(pixels, 0.0, 2).max() <= 1


def test_the_parameters_of_a_spike_camera_are_found() -> None:
    """K = (1 + s^2/Q)/Q with threshold noise s, and all that follows from it."""
    setting = replace(
        silicon_setting("spiketwo", SHAPE, THRESHOLD),
        pattern=DevicePattern(prnu=0.03, dark=300.0, dsnu=0.2), threshold_noise=4.0,
    )  # fmt: skip
    bench = Bench(
        SpikeCounter(setting, SECONDS), setting.chip.pixel_area, SECONDS, (0.01, 0.1, 0.2),
        rows=16, levels=8, frames=6, stack=24, bias=1e4, dark_bias=0.0,
    )  # fmt: skip
    report = measure_camera(bench)
    excess = 1 + 4.0**2 / THRESHOLD
    truth = {
        "gain": excess / THRESHOLD, "quantum_efficiency": 0.7 / excess,
        "responsivity": 0.7 / THRESHOLD, "dark_current": 300.0 / excess, "prnu": 3.0,
        "dark_noise": math.sqrt(1 / 6 - 1 / 12) * THRESHOLD / excess,
    }  # fmt: skip
    missed = [name for name, value in truth.items() if not report[name].holds(value)]
    assert len(missed) <= 1, [(n, truth[n], report[n]) for n in missed]
    for name, value in truth.items():
        found = report[name]
        side = found.high - found.value if value > found.value else found.value - found.low
        assert abs(value - found.value) < FAR * side, (name, value, found)
    # A spike in every cycle fills the count.
    full = SECONDS * 40_000 * THRESHOLD / 0.7
    assert 0.8 * full < report["saturation_photons"].value < 1.1 * full
    assert photons_per_lux(555) * setting.chip.pixel_area * 0.7 == setting.electrons_per_lux


def test_every_spike_camera_has_a_bench() -> None:
    assert list(SPIKE_CAMERAS) == ["spiketwo", "spikeone"]
    for camera in SPIKE_CAMERAS.values():
        assert camera.bench(3).seed == 3
