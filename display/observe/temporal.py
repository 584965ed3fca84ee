"""The eye's response in time: what its sensitivity and its images have in common."""

from __future__ import annotations

import math
from typing import Final

__all__ = ["STAGES", "STAGE_TIME", "frequency_scale"]

STAGES: Final = 15
"""Of the cascade that low-passes light: the sustained term of elaTCSF."""
STAGE_TIME: Final = 0.00292069
"""Seconds of each stage where the scale of frequencies is 1 (elaTCSF's tau)."""
SPEED: Final = 0.6678, 0.222269
"""How frequencies scale with luminance."""
DIMMEST: Final = 0.1
"""cd/m2, below which light is taken as of this: the scale of frequencies ends in 0 at 0.001."""


def frequency_scale(luminance: float) -> float:
    """By how much faster the eye is at this luminance (cd/m2): elaTCSF's f' = f / scale in the
    fovea."""
    return SPEED[0] + SPEED[1] * math.log10(max(luminance, DIMMEST))
