"""Dynamic range of an imager by the closed forms of its pixels: the light at saturation over the
light whose signal equals the noise in the dark."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from imagers.common.kind import Comparison
from sensor.dynamic_range import decibels
from sensor.frame_pixels import Exposed

_STEADY: Final = 1e3
"""Exposure at which the smear of the EMCCD, which is not a signal, is negligible, s."""
_NOISELESS: Final = frozenset({"direct light", "dark current"})
"""Effects of a value without noise."""


def black_and_slope(pixels: Any, seconds: float) -> tuple[float, float]:
    """The value without light after `seconds`, DN, and the responsivity, DN/(lx s), by the closed
    form."""
    step = 1e-6
    lit, dark = (pixels.mean_variance(light, _STEADY)[0] for light in (step, 0.0))
    return pixels.mean_variance(0.0, seconds)[0], (lit - dark) / step


def ends(pixels: Any, seconds: float) -> tuple[float, float]:
    """Least and most light of one exposure, lx s: the light whose signal equals the noise in the
    dark, and the light at saturation (of converter or well), computed without noise. Pixels whose
    values are not in proportion to light state theirs (`light_range`)."""
    if hasattr(pixels, "light_range"):
        least, most = pixels.light_range(seconds)
        return least, most
    black, slope = black_and_slope(pixels, seconds)
    _, variance = pixels.mean_variance(0.0, seconds)
    full = (1 << pixels.bits) - 1
    rows, columns = pixels.shape
    flood = np.full((rows, columns), 4 * (full - black) / slope)
    still = Exposed(flood, np.full(rows, seconds), np.zeros(rows), 0, 0)
    effects = _NOISELESS & pixels.effects.keys()
    highest = float(np.median(pixels.convert(still, 1, effects)[rows // 2]))
    return variance**0.5 / slope, (min(highest, full) - black) / slope


def signal_to_noise(pixels: Any, lux: float, seconds: float) -> float:
    """Signal over its temporal noise at an illuminance, by the closed form of the pixels."""
    if hasattr(pixels, "snr"):
        return float(pixels.snr(lux * seconds, seconds))
    _, variance = pixels.mean_variance(lux * seconds, seconds)
    return float(black_and_slope(pixels, seconds)[1] * lux * seconds / variance**0.5)


def one_frame(pixels: Any, seconds: float) -> float:
    """Dynamic range of one frame of this exposure, dB."""
    least, most = ends(pixels, seconds)
    return decibels(most / least)


def with_controls(comparison: Comparison, pixels: Any) -> float:
    """Dynamic range over all settings of exposure, gain and high voltage, dB."""
    low, high = comparison.extremes(pixels)
    most = ends(low.pixels, low.seconds)[1] / low.seconds
    least = ends(high.pixels, high.seconds)[0] / high.seconds
    return decibels(most / least)
