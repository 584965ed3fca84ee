"""Flicker of a light waveform: percent flicker, flicker index, and the class of IEEE Std 1789-2015.

Percent flicker is (max - min) / (max + min); the flicker index is the area above the mean over the
whole area (both of the IES lighting handbook, over whole periods). IEEE 1789 limits the modulation,
in percent, by its frequency: see `LIMITS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from display.quality.spectrum import Spectrum, spectrum, waveform

__all__ = [
    "LIMITS",
    "Ieee1789",
    "flicker_index",
    "ieee_1789",
    "ieee_1789_of",
    "percent_flicker",
    "risk_of",
]

Risk = Literal["no effect", "low risk", "high risk"]
EXEMPT: Final = 3000.0
"""Hz from which no modulation is limited."""
LIMITS: Final = (
    (90.0, 0.01, 0.025),
    (1250.0, 0.0333, 0.08),
    (EXEMPT, 0.0333, math.inf),
)
"""(up to Hz, percent of modulation per Hz without effect, per Hz at low risk)."""


def percent_flicker(wave: npt.ArrayLike) -> float:
    """100 (max - min) / (max + min) of sampled light, %."""
    light = waveform(wave)
    return float(100 * (light.max() - light.min()) / (light.max() + light.min()))


def flicker_index(wave: npt.ArrayLike) -> float:
    """Area above the mean over the whole area, 0 to 1, of light sampled over whole periods."""
    light = waveform(wave)
    mean = light.mean()
    return float(np.maximum(light - mean, 0).mean() / mean)


@dataclass(frozen=True)
class Ieee1789:
    """Flicker of a display against the limits of IEEE Std 1789-2015.

    Attributes:
        frequency: Hz, dominant.
        modulation: % at it.
        no_effect, low_risk: the limits there, %.
    """

    frequency: float
    modulation: float
    no_effect: float
    low_risk: float
    risk: Risk


def risk_of(frequency: float, modulation: float) -> Ieee1789:
    """The class of a modulation of so many percent at a frequency in Hz."""
    no_effect = low_risk = math.inf
    for up_to, none, low in LIMITS:
        if frequency < up_to:
            no_effect, low_risk = none * frequency, low * frequency
            break
    risk: Risk = "high risk"
    if modulation <= no_effect:
        risk = "no effect"
    elif modulation <= low_risk:
        risk = "low risk"
    return Ieee1789(frequency, modulation, no_effect, low_risk, risk)


def ieee_1789(wave: npt.ArrayLike, rate: float) -> Ieee1789:
    """The class of light sampled `rate` times a second: of its strongest component, whose amplitude
    over the mean is the modulation. That of short pulses exceeds 100 %: they have harmonics beside
    it. Of noise it is the energy in about a hertz (see `spectrum`)."""
    return ieee_1789_of(spectrum(wave, rate))


def ieee_1789_of(lines: Spectrum) -> Ieee1789:
    """The class of a spectrum."""
    frequency, contrast = lines.components()
    k = int(np.argmax(contrast))
    return risk_of(float(frequency[k]), float(100 * contrast[k]))
