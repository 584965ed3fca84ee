"""Exposure loops and sums as one would first write them: what the checks must refuse."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from imagers.ebaps.device.exposure import DEFAULT_EXPOSURE, LATENCY, ExposureRule


def unclipped(rule: ExposureRule, brightness: Callable[[int, int], int], frames: int) -> list[int]:
    """Forgets the range."""
    standing = DEFAULT_EXPOSURE
    exposures: list[int] = []
    for frame in range(frames):
        seen = frame - LATENCY
        if seen >= 0 and exposures[seen] == standing:
            standing -= rule.step * rule.side(brightness(seen, exposures[seen]), 1)
        exposures.append(standing)
    return exposures


def proportional(
    rule: ExposureRule, brightness: Callable[[int, int], int], frames: int
) -> list[int]:
    """Divides what is wanted by what is seen: one leap, and no light is a division by zero."""
    standing = float(DEFAULT_EXPOSURE)
    exposures: list[int] = []
    for frame in range(frames):
        seen = frame - LATENCY
        if seen >= 0:
            standing *= 24_800 / max(brightness(seen, exposures[seen]), 1e-9)
            standing = min(max(standing, 0.0), 1e18)
        exposures.append(int(standing))
    return exposures


def float32_sum(frame: npt.NDArray[np.uint16]) -> int:
    """One after the other in single precision."""
    return int(np.cumsum(frame, dtype=np.float32)[-1])


def sum_of_32_bits(frame: npt.NDArray[np.uint16]) -> int:
    """Wraps."""
    return int(frame.sum(dtype=np.uint32))
