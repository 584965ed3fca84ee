"""Suppression of the fixed pattern: the mean of four dark frames is subtracted from the live frame.

Document 002, section 3.2. The mean is sum >> 2. The truncation lowers it by 3/8 DN on average, so
the difference is too large by this amount (variance of the truncation: 5/64 DN^2 if the noise is a
few DN). The difference is unsigned, as the 16 bits of the memory: negative values become zero,
which raises a mean near zero (`clipped_mean`). `pedestal` can be added before to avoid this.

Residual: with dark frames of the same exposure the dark fixed pattern is removed completely, and
the noise of their mean remains as a fixed pattern of variance var_dark/4 + 5/64. With dark frames
of another exposure, the pattern of the dark current remains in proportion to the difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = [
    "DARKS", "TRUNCATION", "TRUNCATION_VARIANCE", "clipped_mean", "mean_of_four",
    "residual_variance", "stale_variance", "subtract",
]  # fmt: skip

DARKS = 4
"""Frames in the dark mean: document 002, section 3.2."""
TRUNCATION = 3 / 8
"""Mean of what >> 2 drops, DN: of 0, 1, 2, 3 quarters."""
TRUNCATION_VARIANCE = 5 / 64
"""Variance of what >> 2 drops, DN^2."""

Image = npt.NDArray[np.uint16]


def mean_of_four(frames: Sequence[Image]) -> Image:
    """(H, W) of four frames: their sum in 18 bits, shifted right by two."""
    if len(frames) != DARKS:
        raise ValueError(f"there must be {DARKS} dark frames, not {len(frames)}")
    total = np.zeros(frames[0].shape, np.uint32)
    for frame in frames:
        total += frame
    return (total >> 2).astype(np.uint16)


def subtract(live: Image, dark: Image, pedestal: int = 0) -> Image:
    """(H, W) live - dark + pedestal, held within 16 bits."""
    difference = live.astype(np.int32) - dark + pedestal
    return np.clip(difference, 0, 65_535).astype(np.uint16)


def residual_variance(dark: float, live: float = 0.0, frames: int = 1) -> float:
    """Residual spatial variance of the mean of `frames` corrected frames in the dark, DN^2.

    dark, live: temporal variance of a pixel in a dark frame and in a live one, DN^2.
    """
    return dark / DARKS + TRUNCATION_VARIANCE + live / frames


def stale_variance(spread: float, live: float, dark: float) -> float:
    """Additional residual variance with dark frames of another exposure, DN^2.

    Args:
        spread: standard deviation over pixels of the dark current, DN/s.
        live, dark: exposures, s.
    """
    return (spread * (live - dark)) ** 2


def clipped_mean(mean: float, deviation: float) -> float:
    """Mean of a normal value with negative values set to 0: m Phi(m/s) + s phi(m/s)."""
    if deviation <= 0:
        return max(mean, 0.0)
    z = mean / deviation
    below = 0.5 * math.erfc(-z / math.sqrt(2))
    return mean * below + deviation * math.exp(-z * z / 2) / math.sqrt(2 * math.pi)
