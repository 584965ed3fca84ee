"""A chain's dynamic range measured: electrons, volts and codes are drawn, nothing is assumed of how
noises add.

Measured as it would be on a bench: values in the dark and at a few signals about SNR 1, the
response's slope at half scale, and the value under far too much light. The signal where SNR is 1 is
interpolated; the signal at which a straight response reaches the top is the saturation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import normal, poisson
from cosim.compute.streams import Stream
from sensor.dynamic_range.chain import Chain
from sensor.dynamic_range.parts import decibels

Values = npt.NDArray[np.float64]

_PEDESTAL: Final = 12.0
"""Deviations of the noise by which the converter's zero lies below black, so that darkness is not
clipped; its scale is that much longer."""
_ABOUT: Final = (0.8, 1.25)
"""Signals that SNR 1 is sought between, in the least signal foreseen."""


@dataclass(frozen=True)
class MeasuredRange:
    """A dynamic range measured on simulated frames.

    Attributes:
        db: dynamic range with its limits.
        least: electrons at SNR 1.
        saturation: electrons.
    """

    db: float
    low: float
    high: float
    least: float
    saturation: float


def chain_values(chain: Chain, electrons: float, samples: int, seed: int, frame: int) -> Values:
    """(samples,) output codes, black at 0, of a mean signal. frame: counts the draws."""
    numbers = np.arange(samples, dtype=np.int64)
    filled = poisson(electrons, numbers, frame, seed, Stream.IMAGER_SHOT).astype(np.float64)
    # The well ends the signal; what the sensor's noise adds is not in the well.
    charge = np.minimum(filled, chain.full_well)
    charge = charge + chain.noise * normal(numbers, frame, seed, Stream.IMAGER_DARK)
    volts = charge * chain.sensitivity
    volts += chain.circuit * normal(numbers, frame, seed, Stream.IMAGER_RESET)
    volts *= chain.analog
    converter, top = chain.converter, (1 << chain.converter.bits) - 1
    volts += converter.noise * normal(numbers, frame, seed, Stream.IMAGER_READ)
    black = math.ceil(_PEDESTAL * chain.floor * chain.sensitivity * chain.analog / converter.step)
    codes = np.clip(np.rint(volts / converter.step), -black, top)
    low = -math.floor(black * chain.digital)
    return np.clip(np.floor(codes * chain.digital + 0.5), low, top)  # halves up, as adders do


def measure_chain(
    chain: Chain, samples: int = 40_000, seed: int = 1, deviations: float = 2.576
) -> MeasuredRange:
    """The dynamic range of `samples` values a signal. deviations: of the limits, 2.576 for 99 %."""
    frame = 0

    def taken(electrons: float) -> tuple[float, float, float]:
        """Mean, variance, variance of that variance."""
        nonlocal frame
        frame += 1
        values = chain_values(chain, electrons, samples, seed, frame)
        off = values - values.mean()
        variance = float((off**2).sum() / (samples - 1))
        return float(values.mean()), variance, float((off**2).var() / samples)

    dark, dark_variance, _ = taken(0.0)
    half = chain.saturation / 2
    middle, middle_variance, _ = taken(half)
    slope = (middle - dark) / half
    slope_variance = (middle_variance + dark_variance) / samples / half**2
    top, top_variance, _ = taken(4 * chain.saturation)
    saturation = (top - dark) / slope
    # log SNR against log signal is nearly straight over so short a stretch.
    points = []
    for share in _ABOUT:
        signal = share * chain.least
        _, variance, spread = taken(signal)  # the slope gives the mean far more exactly
        snr = slope * signal / math.sqrt(variance)
        relative = spread / (4 * variance**2) + slope_variance / slope**2
        points.append((math.log(signal), math.log(snr), relative))
    (x0, y0, v0), (x1, y1, v1) = points
    rise = (y1 - y0) / (x1 - x0)
    part = -y0 / (y1 - y0)
    least = math.exp(x0 + part * (x1 - x0))
    error = ((1 - part) ** 2 * v0 + part**2 * v1) / rise**2
    error += slope_variance / slope**2
    error += (top_variance + dark_variance) / samples / (top - dark) ** 2
    db = decibels(saturation / least)
    width = decibels(math.exp(1)) * deviations * math.sqrt(error)
    return MeasuredRange(db, db - width, db + width, least, saturation)
