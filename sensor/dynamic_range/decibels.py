"""Ratios of signals in decibels, 20 log10: a factor of ten in light is 20 dB."""

from __future__ import annotations

import math


def decibels(ratio: float) -> float:
    """20 log10 of a ratio above 0."""
    return 20 * math.log10(ratio)


def as_ratio(db: float) -> float:
    """The ratio of so many decibels."""
    return float(10 ** (db / 20))


def sensor_dynamic_range(saturation: float, noise: float) -> float:
    """A sensor's dynamic range, dB: saturation over noise, both in electrons (Wang et al., patent
    of 2017, its first formula). 40 000 e over 25 e are 64.08 dB; without noise it has no end."""
    return decibels(saturation / noise) if noise > 0 else math.inf
