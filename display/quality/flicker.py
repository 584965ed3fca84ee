"""Flicker of a light waveform: percent flicker, flicker index, and the class of IEEE Std 1789-2015.

Percent flicker is (max - min) / (max + min). The flicker index is the area above the mean over the
total area (both from the IES lighting handbook, over whole periods). IEEE 1789 limits the
modulation, in percent, depending on its frequency: see `LIMITS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from display.quality.spectrum import Spectrum, waveform

Risk = Literal["no effect", "low risk", "high risk"]
EXEMPT: Final = 3000.0
"""Frequency from which modulation has no limit, Hz."""
LIMITS: Final = (
    (90.0, 0.01, 0.025),
    (1250.0, 0.0333, 0.08),
    (EXEMPT, 0.0333, math.inf),
)
"""(upper frequency, Hz; modulation without effect, %/Hz; modulation at low risk, %/Hz)."""


def percent_flicker(wave: npt.ArrayLike) -> float:
    """Percent flicker 100 (max - min) / (max + min) of sampled light, %."""
    light = waveform(wave)
    return float(100 * (light.max() - light.min()) / (light.max() + light.min()))


def flicker_index(wave: npt.ArrayLike) -> float:
    """Flicker index, 0 to 1, of light sampled over whole periods."""
    light = waveform(wave)
    mean = light.mean()
    return float(np.maximum(light - mean, 0).mean() / mean)


@dataclass(frozen=True)
class Ieee1789:
    """Flicker of a display against the limits of IEEE Std 1789-2015.

    Attributes:
        frequency: dominant frequency, Hz.
        modulation: modulation at this frequency, %.
        no_effect, low_risk: limits at this frequency, %.
        risk: class.
    """

    frequency: float
    modulation: float
    no_effect: float
    low_risk: float
    risk: Risk


def risk_of(frequency: float, modulation: float) -> Ieee1789:
    """The class of a modulation, %, at a frequency, Hz."""
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


def ieee_1789_of(lines: Spectrum) -> Ieee1789:
    """The class of a spectrum of light, by its strongest component, whose amplitude over the mean
    is the modulation. For short pulses, which have harmonics, it exceeds 100 %. For noise, it is
    the energy in about one hertz (see `spectrum`)."""
    frequency, contrast = lines.components()
    k = int(np.argmax(contrast))
    return risk_of(float(frequency[k]), float(100 * contrast[k]))
