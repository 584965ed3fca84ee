"""The stroboscopic effect visibility measure (SVM) of a light waveform.

SVM = (sum of (C_m / T(f_m))^3.7)^(1 / 3.7) over its components from 80 to 2000 Hz, C_m being the
amplitude of each over the mean and T the threshold contrast of a sine. Above 1 an average observer
sees moving things in steps; the EU allows lamps 0.4 (Regulation 2019/2020). The method is that of
IEC TR 63158, after Perz et al., Lighting Res. Technol. 47:281, 2015. The constants of T were not
found in a source that can be cited; they are from memory, and put the threshold at 0.26 at 100 Hz.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from display.quality.spectrum import Spectrum, Values, spectrum

__all__ = ["LEAST_RATE", "check_svm", "svm", "svm_of", "svm_threshold"]

EXPONENT: Final = 3.7
LOWEST: Final = 80.0
HIGHEST: Final = 2000.0
"""Hz of components that count."""
LEAST_SECONDS: Final = 1.0
LEAST_RATE: Final = 4000.0
"""Hz, samples: twice the highest component."""


def svm_threshold(frequency: npt.ArrayLike) -> Values:
    """T(f), the contrast of a sine whose stroboscopic effect is just visible; f in Hz."""
    f = np.asarray(frequency, np.float64)
    return 1 / (1 + np.exp(-0.00518 * (f - 306.6))) + 20 * np.exp(-f / 10)


def svm(wave: npt.ArrayLike, rate: float) -> float:
    """SVM of light sampled `rate` times a second.

    Raises ValueError for less than 1 s, or less than 4000 samples a second. What leaks from a line
    into bins beside it is put back before the power 3.7 is taken (see `spectrum`).
    """
    check_svm(np.size(wave) / rate, rate)
    return svm_of(spectrum(wave, rate))


def check_svm(seconds: float, rate: float) -> None:
    """Raises ValueError for less than 1 s, or less than 4000 samples a second."""
    if seconds < LEAST_SECONDS * (1 - 1e-9) or rate < LEAST_RATE:
        raise ValueError(
            f"SVM needs at least {LEAST_SECONDS:g} s sampled at {LEAST_RATE:g} Hz or more, not "
            f"{seconds:g} s at {rate:g} Hz"
        )


def svm_of(lines: Spectrum) -> float:
    """SVM of a spectrum."""
    frequency, visible = lines.components(1 / svm_threshold(lines.frequency))
    counts = (frequency >= LOWEST) & (frequency <= HIGHEST)
    return float((visible[counts] ** EXPONENT).sum() ** (1 / EXPONENT))
