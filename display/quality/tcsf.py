"""Visibility of flicker: the temporal contrast sensitivity of elaTCSF, and light weighted by it.

elaTCSF (Cai et al., SIGGRAPH Asia 2024) gives the sensitivity at a place of the visual field, by
frequency, eccentricity and luminance, and pools it over the area that flickers. Its parts are for
one frequency; here those of a waveform are put together as energy, the root of the sum of squares,
which does not depend on the viewing time of noise. That pooling is assumed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from display.observe.temporal import DIMMEST, STAGE_TIME, STAGES, frequency_scale
from display.quality.spectrum import Spectrum, Values, spectrum

__all__ = ["critical_frequency", "sensitivity", "tcsf", "tcsf_visibility", "tcsf_visibility_of"]

KAPPA: Final = 2.12547
GAIN: Final = 154.133
ZETA: Final = 0.721095
FASTER: Final = 16
"""The response in time: stages of the second cascade, and their time over that of the first."""
FADING: Final = 0.0330933
PEAK: Final = 1.76801
DIMMING: Final = 1.62402, 0.533781
"""Sensitivity by eccentricity (decades a degree) and by luminance (cd/m2, exponent)."""
STRETCH: Final = 0.0341811, 2.0
"""How frequencies scale with eccentricity."""
BETA: Final = 3.80022
AREA: Final = 6.52801
"""Pooling over area, square degrees."""
HIGHEST: Final = 300.0
"""Hz beyond which sensitivity is taken as 0."""
NODES: Final = 4, 24
"""Of Gauss and Legendre along each half of a field: of up to a degree, and of any."""


def _cascade(turn: Values, stages: int) -> npt.NDArray[np.complex128]:
    """(1 + i turn)^-stages, by its size and its angle: complex powers take ten times as long."""
    return np.asarray((1 + turn**2) ** (-stages / 2) * np.exp(-1j * stages * np.arctan(turn)))


def tcsf(frequency: npt.ArrayLike, eccentricity: npt.ArrayLike, luminance: float) -> Values:
    """Sensitivity (1 / threshold contrast) at one place of the visual field, not yet pooled over
    area.

    Args:
        frequency: Hz.
        eccentricity: degrees.
        luminance: cd/m2, mean.
    """
    f, e = np.asarray(frequency, np.float64), np.asarray(eccentricity, np.float64)
    lit = max(luminance, DIMMEST)
    per, offset = STRETCH
    scaled = (f + offset) / (1 + per * e) - offset
    turn = 2 * np.pi * scaled / frequency_scale(lit) * STAGE_TIME
    response = np.abs(_cascade(turn, STAGES) - ZETA * _cascade(KAPPA * turn, FASTER))
    bright = PEAK * (1 + DIMMING[0] / lit) ** -DIMMING[1]
    return np.asarray(10 ** (-FADING * e) * bright * GAIN * response)


def sensitivity(
    frequency: npt.ArrayLike, luminance: float, field: tuple[float, float]
) -> npt.NDArray[np.float64]:
    """Sensitivity to a field of (width, height) degrees that flickers as one, fixated in its
    middle. frequency: (n,) Hz."""
    width, height = field
    if not (width > 0 and height > 0):
        raise ValueError(f"field must be wider and higher than 0 degrees, not {width} x {height}")
    node, weight = np.polynomial.legendre.leggauss(NODES[max(field) > 1])
    x, y = (node + 1) * width / 4, (node + 1) * height / 4
    apart = np.hypot(x[:, None], y[None, :]).ravel()
    area = (weight[:, None] * weight[None, :]).ravel() * width * height / 4
    f = np.atleast_1d(np.asarray(frequency, np.float64))
    pooled = tcsf(f[:, None], apart[None, :], luminance) ** BETA @ area / AREA
    return np.asarray(pooled ** (1 / BETA))


def critical_frequency(contrast: float, luminance: float, field: tuple[float, float]) -> float:
    """Hz above which a sine of this contrast is not seen (critical flicker frequency). Raises
    ValueError where it is not seen at 10 Hz either."""
    from scipy.optimize import brentq

    def beyond(f: float) -> float:
        return float(contrast * sensitivity(f, luminance, field)[0]) - 1

    if beyond(10.0) < 0:
        raise ValueError(f"contrast must be visible at 10 Hz, not {contrast:g}")
    return float(brentq(beyond, 10.0, 500.0))


def tcsf_visibility(
    wave: npt.ArrayLike, rate: float, luminance: float, field: tuple[float, float]
) -> float:
    """How far beyond threshold the flicker of light sampled `rate` times a second is: above 1 it is
    seen.

    Args:
        luminance: cd/m2, mean.
        field: (width, height) degrees that flicker as one.
    """
    return tcsf_visibility_of(spectrum(wave, rate), luminance, field)


def tcsf_visibility_of(lines: Spectrum, luminance: float, field: tuple[float, float]) -> float:
    """The same of a spectrum."""
    gain = _gains(len(lines.frequency), float(lines.frequency[1]), luminance, field)
    return float(np.sqrt((lines.energy[: len(gain)] * gain**2).sum()))


@lru_cache(maxsize=32)
def _gains(bins: int, step: float, luminance: float, field: tuple[float, float]) -> Values:
    """Sensitivity at the bins of a spectrum. Nothing is seen far beyond the critical frequency:
    those need no pooling over the field."""
    return sensitivity(np.arange(min(bins, int(HIGHEST / step) + 1)) * step, luminance, field)
