"""Short-term light modulation, PstLM: the IEC light flickermeter.

The method is that of IEC TR 61547-1, as in its public reference code: the light over its mean is
band-limited, weighted by the response of the eye to flicker, squared and smoothed. PstLM combines
the levels that are exceeded in certain percentages of the time. A value of 1 is the flicker that
half of the observers find irritating. All filters are second-order sections: as one polynomial, the
high-pass at 0.05 Hz would be inaccurate at high sampling rates.
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
"""Corner frequencies of Butterworth filters of order 1 and 6, Hz."""
WEIGHTING: Final = (
    (0.041661, 44.758, 2715.6, 29839.0, 0.0),
    (1.0, 196.32, 11781.0, 534820.0, 3505380.0),
)
"""Numerator and denominator of H(s), from light to visible flicker."""
SCALE: Final = 1.101603155420234e6
SMOOTHING: Final = 0.3
"""Time constant of the smoothing, s."""
SETTLING: Final = 20.0
"""Time at the start that is not evaluated, s."""
LEVELS: Final = (
    (0.0314, (0.1,)),
    (0.0525, (0.7, 1.0, 1.5)),
    (0.0657, (2.2, 3.0, 4.0)),
    (0.28, (6.0, 8.0, 10.0, 13.0, 17.0)),
    (0.08, (30.0, 50.0, 80.0)),
)
"""(weight, percentages of the time): each term is the mean of the levels exceeded in these
percentages."""
LEAST_SECONDS: Final = SETTLING + SMOOTHING / 0.007
"""Minimum length of a waveform, s: 0.7 % of the time must be at least the smoothing time. The term
of 0.1 % would need 320 s; for light that is not periodic, the difference is below the spread of the
term."""
LEAST_RATE: Final = 400.0
"""Minimum sampling rate, Hz: the bilinear transform then shifts 9 Hz by less than 0.2 %."""


@lru_cache(maxsize=8)
def _sections(rate: float) -> Values:
    """Second-order sections of all filters before the square, for the sampling rate `rate`, Hz."""
    from scipy import signal  # the import takes 0.5 s

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
    """PstLM of light sampled at `rate`, Hz. It is 0 for steady light, and proportional to the depth
    of a modulation. Raises ValueError for less than LEAST_SECONDS or LEAST_RATE."""
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
