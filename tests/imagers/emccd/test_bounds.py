"""Bounds of EMCCD effects hold against paired frames, the same draws with and without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from imagers.emccd.pixels import EmccdPixels, chip
from sensor.frame_pixels import Exposed

FRAMES, ROWS = 30, 4
LIT = slice(chip.DARK_COLUMNS, -chip.DARK_COLUMNS)


def film(
    pixels: EmccdPixels, light: np.ndarray, seconds: float, kept: frozenset[str]
) -> np.ndarray:
    """(frames, rows, 512) DN over the offset."""
    times = np.full(ROWS, seconds), np.zeros(ROWS)
    frames = [pixels.convert(Exposed(light, *times, 100, n), 1, kept) for n in range(FRAMES)]
    return np.stack(frames)[:, :, LIT].astype(float) - pixels.offset


def change(full: np.ndarray, without: np.ndarray) -> float:
    """Larger of: RMS over pixels of the mean's change, less its own noise, over the mean; and the
    relative change of the noise, less five standard errors."""
    moved = full - without
    power = moved.mean(axis=0) ** 2 - moved.var(axis=0, ddof=1) / FRAMES
    scatter = 5 * power.std() / np.sqrt(power.size)
    mean = np.sqrt(max(power.mean() - scatter, 0.0)) / max(full.mean(), 1.0)
    sd = [max(v.std(axis=0, ddof=1).mean(), 12**-0.5) for v in (full, without)]
    noise = abs(sd[1] / sd[0] - 1) - 5 / np.sqrt(2 * full.size)
    return float(max(mean, noise))


@pytest.mark.parametrize(
    ("gain", "electrons", "seconds", "kelvin"),
    [
        (1.0, 2000.0, 40e-3, 263.15),
        (300.0, 3.0, 40e-3, 263.15),
        (100.0, 0.2, 40e-3, 283.15),
        (20.0, 50.0, 1e-4, 263.15),
    ],
)
def test_leaving_one_out(gain: float, electrons: float, seconds: float, kelvin: float) -> None:
    pixels = EmccdPixels(gain=gain, kelvin=kelvin)
    light = np.full((ROWS, chip.COLUMNS), electrons / pixels.responsivity)
    light[:, 268:] *= 1.5
    summary = pixels.summary((light.min(), light.max()), (seconds, seconds), FRAMES)
    everything = frozenset(pixels.effects)
    full = film(pixels, light, seconds, everything)
    for name, effect in pixels.effects.items():
        bound = effect.bound(summary)
        promise = float(bound.value) * (1 if bound.kind == "proof" else 2)
        found = change(full, film(pixels, light, seconds, everything - {name}))
        assert found <= promise, name
        assert effect.cost(summary) > 0, name


def test_bounds_are_not_idle() -> None:
    """At 3 electrons and gain 300 both noises are large and found within a third of their bounds;
    read noise is nothing."""
    pixels = EmccdPixels(gain=300.0)
    light = np.full((ROWS, chip.COLUMNS), 3 / pixels.responsivity)
    summary = pixels.summary((light.min(), light.max()), (0.04, 0.04), FRAMES)
    everything = frozenset(pixels.effects)
    full = film(pixels, light, 0.04, everything)
    for name in ("shot noise", "multiplication noise"):
        promise = float(pixels.effects[name].bound(summary).value)
        assert change(full, film(pixels, light, 0.04, everything - {name})) > promise * 0.66
    assert float(pixels.effects["read noise"].bound(summary).value) < 2e-3


def test_bounds_cover_a_range_of_gains() -> None:
    """Of frames whose gain a register sets: never less than at any gain within the range."""
    light = 200 / EmccdPixels().responsivity
    wide = replace(EmccdPixels().summary((light, light), (0.04, 0.04), 1), gain=(1.0, 500.0))
    bounds = {n: float(e.bound(wide).value) for n, e in EmccdPixels().effects.items()}
    for gain in (1.0, 1.7, 5.0, 11.3, 40.0, 500.0):
        pixels = EmccdPixels(gain=gain)
        own = pixels.summary((light, light), (0.04, 0.04), 1)
        for name, effect in pixels.effects.items():
            assert float(effect.bound(own).value) <= bounds[name] * (1 + 1e-12), (name, gain)


def test_overflow_is_promised_where_it_comes() -> None:
    """Register overflow: nothing below the well, and more than what is found above it."""
    pixels = EmccdPixels(gain=200.0)
    light = np.zeros((ROWS, chip.COLUMNS))
    light[:, 300:] = pixels.lux_seconds(5000.0, 0.04)
    light[:, :300] = pixels.lux_seconds(50.0, 0.04)
    summary = pixels.summary((light.min(), light.max()), (0.04, 0.04), FRAMES)
    everything = frozenset(pixels.effects)
    full = film(pixels, light, 0.04, everything)
    found = change(full, film(pixels, light, 0.04, everything - {"register overflow"}))
    bound = pixels.effects["register overflow"].bound(summary)
    assert bound.kind == "estimate"
    assert 0.01 < found <= 2 * float(bound.value)
    # The one place that takes most: no more than a well, over the dark of it.
    assert float(bound.value) < 4000 / 50 * 1.3
    low = pixels.summary((light.min(), light.min()), (0.04, 0.04), FRAMES)
    assert float(pixels.effects["register overflow"].bound(low).value) < 1e-9
