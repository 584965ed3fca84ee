"""Dynamic range of each camera by the closed forms of its own pixels: light at which values end
over light whose signal equals the noise in the dark."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rtl_model.imagers.adaptive.loop import shortest_exposure
from rtl_model.imagers.adaptive.registers import DEFAULT_LONGEST
from rtl_model.imagers.adaptive.response import longest_exposure
from rtl_model.imagers.ebaps.exposure import ExposureRule
from rtl_model.imagers.emccd.timing import exposure_range
from sensor.dynamic_range import decibels
from sensor.imagers import Exposed
from sensor.imagers.ebaps import EbapsPixels
from sensor.imagers.emccd import GAIN_RANGE, EmccdPixels

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
    where values rise no more (converter or well), which is asked of the pixels without noise."""
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


def with_controls(kind: str, pixels: Any) -> float:
    """Of everything that the imager's exposure, gain and high voltage reach, dB."""
    if kind == "adaptive-exposure":
        short = long = pixels
        times = shortest_exposure(), longest_exposure(DEFAULT_LONGEST)
    elif kind == "ebaps":
        rule, shape = ExposureRule(), (32, 32)
        short, long = EbapsPixels(shape, volts=0.0), EbapsPixels(shape, volts=1500.0)
        times = rule.shortest * 1e-9, rule.longest * 1e-9
    else:
        short, long = (EmccdPixels(gain=g) for g in GAIN_RANGE)
        times = exposure_range()[:2]
    most = ends(short, times[0])[1] / times[0]
    least = ends(long, times[1])[0] / times[1]
    return decibels(most / least)
