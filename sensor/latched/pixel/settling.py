"""Charge beyond the threshold at a write to the threshold's register, under the residual rule.

A kernel meets such charge only within a cycle. After a write it stands before the cycle begins, so
the host takes the thresholds off, as the kernels do at a latch, and the pixel fires in the cycle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.latched.pixel.model import JUMP, ROOM


def settle(
    deficit: npt.NDArray[Any],
    spikes: npt.NDArray[np.uint64],
    q: int,
    draw: Callable[[npt.NDArray[np.uint64], npt.NDArray[np.bool_]], Any],
) -> npt.NDArray[np.bool_]:
    """Takes whole thresholds off until no deficit is below 0.

    Args:
        deficit: (n,) int64, threshold - charge - 1, changed in place.
        spikes: (n,) index of the current interval, changed in place.
        q: mean threshold, in units of the deficit.
        draw: thresholds of these spikes of the pixels of a mask.

    Returns:
        (n,) the pixels that fire.
    """
    fires = deficit < 0
    whole = np.where(deficit < -ROOM * q, np.maximum(-deficit // q - JUMP, 0), 0)
    deficit += whole * q
    spikes += whole.astype(np.uint64)
    due = fires
    while due.any():
        spikes[due] += np.uint64(1)
        deficit[due] += draw(spikes[due], due)
        due = deficit < 0
    return fires
