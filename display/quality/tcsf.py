"""Visibility of flicker by the temporal contrast sensitivity function elaTCSF.

elaTCSF (Cai et al., SIGGRAPH Asia 2024) gives the sensitivity at a point of the visual field by
frequency, eccentricity and luminance, and pools it over the flickering area. It is defined for one
frequency; here the components of a waveform are combined as the root of the sum of squares, which
does not depend on the duration for noise. This combination is assumed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from display.observe.temporal import DIMMEST, STAGE_TIME, STAGES, frequency_scale
from display.quality.spectrum import Spectrum, Values

KAPPA: Final = 2.12547
GAIN: Final = 154.133
ZETA: Final = 0.721095
FASTER: Final = 16
"""Number of stages of the second cascade of the temporal response."""
FADING: Final = 0.0330933
PEAK: Final = 1.76801
DIMMING: Final = 1.62402, 0.533781
"""Decrease of sensitivity with eccentricity (decades per degree), peak, and dependence on luminance
(cd/m2, exponent)."""
STRETCH: Final = 0.0341811, 2.0
"""Scale of frequencies with eccentricity: factor per degree, and offset, Hz."""
BETA: Final = 3.80022
AREA: Final = 6.52801
"""Exponent and unit area, square degrees, of the pooling over area."""
HIGHEST: Final = 300.0
"""Frequency above which the sensitivity is 0, Hz."""
NODES: Final = 4, 24
"""Numbers of Gauss-Legendre nodes along each half of a field: up to one degree, and above."""


def _cascade(turn: Values, stages: int) -> npt.NDArray[np.complex128]:
    """(1 + i turn)^-stages, by magnitude and phase: complex powers take ten times as long."""
    return np.asarray((1 + turn**2) ** (-stages / 2) * np.exp(-1j * stages * np.arctan(turn)))


def tcsf(frequency: npt.ArrayLike, eccentricity: npt.ArrayLike, luminance: float) -> Values:
    """Sensitivity (1 / threshold contrast) at a point of the visual field, before pooling over
    area.

    Args:
        frequency: frequency of the flicker, Hz.
        eccentricity: distance from the centre of the visual field, degrees.
        luminance: mean luminance, cd/m2.
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
    """Sensitivity, (n,), to a field that flickers in phase, fixated at its centre.

    Args:
        frequency: frequencies, Hz, (n,).
        luminance: mean luminance, cd/m2.
        field: (width, height) of the field, degrees.

    Raises:
        ValueError: the field is empty.
    """
    width, height = field
    if not (width > 0 and height > 0):
        raise ValueError(f"field must be wider and higher than 0 degrees, not {width} x {height}")
    node, weight = np.polynomial.legendre.leggauss(NODES[int(max(field) > 1)])
    x, y = (node + 1) * width / 4, (node + 1) * height / 4
    apart = np.hypot(x[:, None], y[None, :]).ravel()
    area = (weight[:, None] * weight[None, :]).ravel() * width * height / 4
    f = np.atleast_1d(np.asarray(frequency, np.float64))
    pooled = tcsf(f[:, None], apart[None, :], luminance) ** BETA @ area / AREA
    return np.asarray(pooled ** (1 / BETA))


def tcsf_visibility_of(lines: Spectrum, luminance: float, field: tuple[float, float]) -> float:
    """Flicker over its threshold; above 1 it is visible.

    Args:
        lines: spectrum of the light.
        luminance: mean luminance, cd/m2.
        field: (width, height) of the field that flickers in phase, degrees.
    """
    gain = _gains(len(lines.frequency), float(lines.frequency[1]), luminance, field)
    return float(np.sqrt((lines.energy[: len(gain)] * gain**2).sum()))


@lru_cache(maxsize=32)
def _gains(bins: int, step: float, luminance: float, field: tuple[float, float]) -> Values:
    """Sensitivity at the bins of a spectrum up to HIGHEST; flicker far above the critical frequency
    is not visible."""
    return sensitivity(np.arange(min(bins, int(HIGHEST / step) + 1)) * step, luminance, field)
