"""Suppression of the fixed pattern: the mean of four dark frames is taken from the live frame.

Document 002, section 3.2. The mean is sum >> 2, as four values need no more: it drops 3/8 DN on
average, so the difference is that much too large (variance of what is dropped: 5/64 DN^2, once the
noise is a few DN). The difference has no sign: what falls below zero becomes zero, as it must in
the unsigned 16 bits of the memory, which lifts a mean near zero (`clipped_mean`); `pedestal` is
added before where that matters.

What is left: the fixed pattern of the dark goes exactly, if the darks were exposed as long as the
live frame; the noise of their mean stays as a pattern of its own, var_dark/4 + 5/64. With darks of
another exposure the dark current's pattern stays in proportion to the difference.
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
    """Spatial variance that is left in the mean of `frames` corrected frames, DN^2, in the dark.

    dark, live: temporal variance of a pixel in a dark frame and in a live one, DN^2.
    """
    return dark / DARKS + TRUNCATION_VARIANCE + live / frames


def stale_variance(spread: float, live: float, dark: float) -> float:
    """What darks of another exposure leave besides, DN^2.

    Args:
        spread: standard deviation over pixels of the dark current, DN/s.
        live, dark: exposures, s.
    """
    return (spread * (live - dark)) ** 2


def clipped_mean(mean: float, deviation: float) -> float:
    """Mean of a normal value after what is below 0 has become 0: m Phi(m/s) + s phi(m/s)."""
    if deviation <= 0:
        return max(mean, 0.0)
    z = mean / deviation
    below = 0.5 * math.erfc(-z / math.sqrt(2))
    return mean * below + deviation * math.exp(-z * z / 2) / math.sqrt(2 * math.pi)
