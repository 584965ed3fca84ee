"""Pixels of the fast tier, with one plan for all of them."""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.clock import Clock
from cosim.compute.opencl import Device
from cosim.run.timing import REAL_TIME
from sensor import EFFECTS
from sensor.device.pattern import FixedPattern
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.pixel.bank import LANES
from sensor.latched.pixel.model import ExactModel

THRESHOLD: Final = 1000.0
"""Threshold of the pixels, electrons."""


def planned_pixels(
    device: Device, shape: tuple[int, int], flags: int, pattern: FixedPattern | None = None
) -> FastPixels:
    """A plane of pixels with all effects, at real time; a unit of light is a threshold a cycle.

    Args:
        device: OpenCL device.
        shape: (H, W).
        flags: effects that all groups keep; see `PixelArray`.
        pattern: fixed pattern, None if all pixels are nominal.
    """
    height, width = shape
    array = PixelArray(
        ExactModel(THRESHOLD, 1, tuple(EFFECTS.values())), shape,
        np.arange(height * width, dtype=np.uint32), Clock.from_hz(REAL_TIME),
        THRESHOLD * REAL_TIME, pattern,
        flags=np.full((height, -(-width // LANES)), flags, np.uint8),
    )  # fmt: skip
    return FastPixels(array, device)
