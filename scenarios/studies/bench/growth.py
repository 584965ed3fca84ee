"""How the cost of a pixel and cycle grows with the number of pixels and the length of a run, for
pixels of the fast tier with one plan for all of them.

The fast tier draws noise from the bank; the picture is that of `sensor.noise`. Sizes for which the
memory of the machine is too small are left out.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.clock import PS, Clock
from cosim.compute.memory import check_memory
from cosim.compute.opencl import Device
from cosim.errors import InputError
from cosim.light.light import Light, Piece
from cosim.run.timing import BRIGHT, DARK, REAL_TIME, TimingRow, least
from sensor import EFFECTS
from sensor.device.pattern import FixedPattern
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.units import BANK, NOISE
from sensor.latched.pixel.bank import LANES
from sensor.latched.pixel.model import ExactModel

THRESHOLD: Final = 1000.0
"""Threshold of the pixels, electrons."""
_WIDTH: Final = 1000
_PIXELS: Final = {f"1e{k}": 10**k for k in range(4, 9)}
_CYCLES: Final = {"64": 64, "512": 512, "4096": 4096, "1e5": 10**5}
_CALL: Final = 512
"""Cycles of a call; longer runs make several."""
_STATE: Final = 60
"""Bytes of a pixel beside its spikes: light, state, number, and copies of them."""


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


def _rate(device: Device, n: int, cycles: int) -> float:
    """Throughput of runs of `cycles` cycles of n pixels, pixel-cycles/s."""
    call = min(_CALL, cycles)
    check_memory("the array", n * (_STATE + call // 8), "none")
    shape = n // _WIDTH, _WIDTH
    picture = np.linspace(DARK, BRIGHT, n, dtype=np.float32).reshape(shape)
    light = Light((Piece(0, 10**4 * PS, picture, picture),))
    pixels, start = planned_pixels(device, shape, BANK | NOISE), 0

    def run() -> None:
        nonlocal start
        for begin in range(start, start + cycles, call):
            pixels.expose(light, begin, min(call, start + cycles - begin))
        start += cycles

    return n * cycles / least(run, 3)


def growth_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """Rows of both; none without an OpenCL device. ceiling: pixel-cycles/s."""
    rows: list[TimingRow] = []
    if device is None:
        return rows
    for name, n, cycles in [
        *((f"growth.pixels-{text}", n, _CALL) for text, n in _PIXELS.items()),
        *((f"growth.cycles-{text}", 10**6, cycles) for text, cycles in _CYCLES.items()),
    ]:
        try:
            value = _rate(device, n, cycles)
        except InputError:
            continue
        share = value / ceiling if ceiling else None
        real = value / (n * REAL_TIME)
        rows.append(TimingRow(name, "bank", value, "pixel-cycles/s", real, share, None))
    return rows
