"""Compares every bit of the pixels' OpenCL kernel with its compiled form. `viform doctor` runs this
file in a child process, because a driver may abort the process."""

from __future__ import annotations

import numpy as np

from cosim.compute.opencl import open_device
from sensor import EFFECTS, make_pixels
from sensor.latched.pixel.charge import Span
from sensor.latched.pixel.model import ExactModel

_PIXELS = _CYCLES = 64


def kernel_agrees() -> bool:
    """Whether the two agree for all effects at 100 e on 64 pixels and 64 cycles. Raises InputError
    without a device."""
    model = ExactModel(100.0, 1, tuple(EFFECTS.values()))
    numbers = np.arange(_PIXELS, dtype=np.uint32)
    spans = [Span(0, _CYCLES, np.arange(_PIXELS) * 2**40)]
    compiled, kernel = (make_pixels(model, numbers, device) for device in (None, open_device()))
    return bool((compiled.expose(spans, _CYCLES) == kernel.expose(spans, _CYCLES)).all())


def main() -> None:
    """Prints whether they agree."""
    print("agree" if kernel_agrees() else "differ")
