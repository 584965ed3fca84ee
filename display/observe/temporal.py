"""The temporal response of the eye, shared by its sensitivity and its images."""

from __future__ import annotations

import math
from typing import Final

STAGES: Final = 15
"""Number of stages of the low-pass cascade, the sustained term of elaTCSF."""
STAGE_TIME: Final = 0.00292069
"""Time constant of each stage at a frequency scale of 1, s (tau of elaTCSF)."""
SPEED: Final = 0.6678, 0.222269
"""Constants of the frequency scale: offset, and slope per decade of luminance."""
DIMMEST: Final = 0.1
"""Lower limit of the luminance, cd/m2: the frequency scale would be 0 at 0.001."""


def frequency_scale(luminance: float) -> float:
    """Scale of the eye's temporal frequencies at a luminance, cd/m2: f' = f / scale of elaTCSF in
    the fovea."""
    return SPEED[0] + SPEED[1] * math.log10(max(luminance, DIMMEST))
