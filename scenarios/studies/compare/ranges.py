"""Dynamic range of each camera by the closed forms of its own pixels: light at which values end
over light whose signal equals the noise in the dark."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rtl_model.imagers.interface.comparison import Comparison
from sensor.dynamic_range import decibels
from sensor.imagers import Exposed

__all__ = ["black_and_slope", "ends", "one_frame", "with_controls"]


_STEADY: Final = 1e3
"""Seconds of an exposure beside which the EMCCD's smear is nothing: it is no signal."""
_WHOLE: Final = frozenset({"direct light", "dark current"})
"""Effects that a value without noise has."""


def black_and_slope(pixels: Any, seconds: float) -> tuple[float, float]:
    """DN without light after so many seconds, and DN of a lux second, by the closed form."""
    step = 1e-6
    lit, dark = (pixels.mean_variance(light, _STEADY)[0] for light in (step, 0.0))
    return pixels.mean_variance(0.0, seconds)[0], (lit - dark) / step


def ends(pixels: Any, seconds: float) -> tuple[float, float]:
    """Least and most light in lx s of one exposure: signal of SNR 1 against the dark's noise, and
    where values rise no more (converter or well), which is computed without noise."""
    black, slope = black_and_slope(pixels, seconds)
    _, variance = pixels.mean_variance(0.0, seconds)
    full = (1 << pixels.bits) - 1
    rows, columns = pixels.shape
    flood = np.full((rows, columns), 4 * (full - black) / slope)
    still = Exposed(flood, np.full(rows, seconds), np.zeros(rows), 0, 0)
    reached = float(np.median(pixels.convert(still, 1, _WHOLE & pixels.effects.keys())[rows // 2]))
    return variance**0.5 / slope, (min(reached, full) - black) / slope


def one_frame(pixels: Any, seconds: float) -> float:
    """Of one frame of this exposure, dB."""
    least, most = ends(pixels, seconds)
    return decibels(most / least)


def with_controls(comparison: Comparison, pixels: Any) -> float:
    """Of everything that the imager's exposure, gain and high voltage reach, dB."""
    low, high = comparison.extremes(pixels)
    most = ends(low.pixels, low.seconds)[1] / low.seconds
    least = ends(high.pixels, high.seconds)[0] / high.seconds
    return decibels(most / least)
