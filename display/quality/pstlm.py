"""Short-term light modulation, PstLM: the IEC light flickermeter of a light waveform.

IEC TR 61547-1, as its public reference code has it: light over its mean is band-limited, weighted
by the eye's response to flicker, squared and smoothed. PstLM combines the levels that are exceeded
in given percentages of the time. 1 is the flicker that half of people find irritating. All filters
are in second-order sections: as one polynomial the high-pass at 0.05 Hz loses its digits at high
rates.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from display.quality.spectrum import Values, waveform

__all__ = ["LEAST_SECONDS", "pst_lm"]

HIGH_PASS: Final = 0.05
LOW_PASS: Final = 35.0
"""Hz, corners of Butterworth filters of order 1 and 6."""
WEIGHTING: Final = (
    (0.041661, 44.758, 2715.6, 29839.0, 0.0),
    (1.0, 196.32, 11781.0, 534820.0, 3505380.0),
)
"""H(s), numerator and denominator: from light to its visible flicker."""
SCALE: Final = 1.101603155420234e6
SMOOTHING: Final = 0.3
"""Seconds, time constant."""
SETTLING: Final = 20.0
"""Seconds at the beginning that are left out."""
LEVELS: Final = (
    (0.0314, (0.1,)),
    (0.0525, (0.7, 1.0, 1.5)),
    (0.0657, (2.2, 3.0, 4.0)),
    (0.28, (6.0, 8.0, 10.0, 13.0, 17.0)),
    (0.08, (30.0, 50.0, 80.0)),
)
"""(weight, percents of the time): each term is the mean of the levels exceeded so long."""
LEAST_SECONDS: Final = SETTLING + SMOOTHING / 0.007
"""What is exceeded 0.7 % of the time must be exceeded for at least a smoothing time. That of 0.1 %
would need 320 s; light that is not periodic changes by less than the term's own spread."""
LEAST_RATE: Final = 400.0
"""Hz, samples: the bilinear transform then moves 9 Hz by less than 0.2 %."""


@lru_cache(maxsize=8)
def _sections(rate: float) -> Values:
    """Second-order sections of all filters before the square, at a sampling rate."""
    from scipy import signal  # half a second: only who measures pays for it

    weight = signal.ZerosPolesGain(*signal.tf2zpk(*WEIGHTING))
    digital = signal.bilinear_zpk(weight.zeros, weight.poles, weight.gain, rate)
    return np.concatenate(
        [
            signal.butter(1, HIGH_PASS, "highpass", fs=rate, output="sos"),
            signal.butter(6, LOW_PASS, "lowpass", fs=rate, output="sos"),
            signal.zpk2sos(*digital),
        ]
    )


def pst_lm(wave: npt.ArrayLike, rate: float) -> float:
    """PstLM of light sampled `rate` times a second; 0 of steady light, and proportional to the
    depth of any modulation. Raises ValueError for less than `LEAST_SECONDS` or 400 Hz."""
    from scipy import signal

    light = waveform(wave)
    seconds = len(light) / rate
    if seconds < LEAST_SECONDS or rate < LEAST_RATE:
        raise ValueError(
            f"PstLM needs at least {LEAST_SECONDS:.1f} s sampled at {LEAST_RATE:g} Hz or more, not "
            f"{seconds:g} s at {rate:g} Hz"
        )
    visible = signal.sosfilt(_sections(rate), light / light.mean() - 1)
    smooth = signal.butter(1, 1 / (2 * np.pi * SMOOTHING), "lowpass", fs=rate, output="sos")
    sensation = signal.sosfilt(smooth, SCALE * visible**2)[round(SETTLING * rate) :]
    total = 0.0
    for weight, percents in LEVELS:
        total += weight * float(np.percentile(sensation, [100 - p for p in percents]).mean())
    return float(np.sqrt(max(total, 0.0)))
