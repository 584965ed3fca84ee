"""Banding of a rolling shutter: measured from a picture, and in closed form for pulses.

Rows begin one after another, so a row sees the light at its own phase. With pulses of the period P
that last d P, an exposure T = (m + u) P collects m d P, and the overlap of a pulse with a window
u P. Over the rows this overlap is a trapezoid. Each harmonic k of the light is weakened by
|sinc(k T / P)|; whole periods leave no bands.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

_DARK = 0.01
"""Rows with less than this share of the light of the brightest row are not measured."""


def banding(
    picture: npt.NDArray[np.float64], steady: npt.NDArray[np.float64]
) -> tuple[float | None, npt.NDArray[np.float64]]:
    """The contrast of bands in a picture, and the profile that it is measured on.

    The contrast is sqrt(2) times the standard deviation of the profile over its mean: that of a
    sine wave is its amplitude over its mean. Noise of the row means counts as bands.

    Args:
        picture: (rows, columns).
        steady: (rows,) mean light of each row over a period of the frame, in the same unit.

    Returns:
        The contrast, None if no row is lit; and the profile, (rows,): mean of each row over its
        steady light, NaN where that is dark.
    """
    lit = steady > max(_DARK * float(steady.max(initial=0.0)), 0.0)
    profile = np.full(len(steady), np.nan)
    profile[lit] = picture.mean(axis=1)[lit] / steady[lit]
    if not lit.any() or not float(profile[lit].mean()):
        return None, profile
    return math.sqrt(2) * float(profile[lit].std() / profile[lit].mean()), profile


def pulse_banding(duty: float, frequency: float, exposure: float) -> float:
    """The same contrast in closed form, for equal pulses and rows at all phases.

    Args:
        duty: share of the period in which the light is on, above 0 to 1.
        frequency: frequency of the pulses, Hz.
        exposure: s.
    """
    periods = exposure * frequency
    u = periods - math.floor(periods)
    on = duty
    if u + on > 1:  # the complement of a window has the same variance
        u, on = 1 - u, 1 - on
    top = min(u, on)
    # The trapezoid rises over `top`, stays for |u - on|, falls over `top`; its mean is u on.
    variance = 2 * top**3 / 3 + top**2 * abs(u - on) - (u * on) ** 2
    return math.sqrt(2 * max(variance, 0.0)) / (periods * duty)
