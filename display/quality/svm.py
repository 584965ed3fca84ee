"""The stroboscopic effect visibility measure (SVM) of a light waveform.

SVM = (sum of (C_m / T(f_m))^3.7)^(1 / 3.7) over the components from 80 to 2000 Hz, where C_m is the
amplitude of a component over the mean and T the threshold contrast of a sine. Above 1, an average
observer perceives moving objects in steps; the EU limit for lamps is 0.4 (Regulation 2019/2020).
The method is that of IEC TR 63158, after Perz et al., Lighting Res. Technol. 47:281, 2015. No
citable source was found for the constants of T; with them, the threshold at 100 Hz is 0.26.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from display.quality.spectrum import Spectrum, Values, spectrum

EXPONENT: Final = 3.7
LOWEST: Final = 80.0
HIGHEST: Final = 2000.0
"""Range of the components that count, Hz."""
LEAST_SECONDS: Final = 1.0
LEAST_RATE: Final = 4000.0
"""Minimum sampling rate, Hz: twice the highest component."""


def svm_threshold(frequency: npt.ArrayLike) -> Values:
    """T(f), the contrast of a sine whose stroboscopic effect is just visible, for f in Hz."""
    f = np.asarray(frequency, np.float64)
    return 1 / (1 + np.exp(-0.00518 * (f - 306.6))) + 20 * np.exp(-f / 10)


def svm(wave: npt.ArrayLike, rate: float) -> float:
    """SVM of light sampled at `rate`, Hz. The leakage of a line is added to it before the power 3.7
    is computed (see `spectrum`). Raises ValueError for less than 1 s or 4000 Hz."""
    check_svm(np.size(wave) / rate, rate)
    return svm_of(spectrum(wave, rate))


def check_svm(seconds: float, rate: float) -> None:
    """Raises ValueError for a waveform of less than 1 s, or a sampling rate below 4000 Hz."""
    if seconds < LEAST_SECONDS * (1 - 1e-9) or rate < LEAST_RATE:
        raise ValueError(
            f"SVM needs at least {LEAST_SECONDS:g} s sampled at {LEAST_RATE:g} Hz or more, not "
            f"{seconds:g} s at {rate:g} Hz"
        )


def svm_of(lines: Spectrum) -> float:
    """SVM of a spectrum."""
    gain = _gains(len(lines.frequency), float(lines.frequency[1]))
    frequency, visible = lines.components(gain)
    counts = (frequency >= LOWEST) & (frequency <= HIGHEST)
    return float((visible[counts] ** EXPONENT).sum() ** (1 / EXPONENT))


@lru_cache(maxsize=4)
def _gains(bins: int, step: float) -> Values:
    """1 / T(f) at the bins of a spectrum, `step` Hz apart."""
    return 1 / svm_threshold(np.arange(bins) * step)
