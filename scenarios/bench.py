"""Throughput against real time, against this machine's measured ceiling, against the plain way.

Everything of a row is measured in one process: one discarded call, then the least of repeated
calls. The plain way is what a numpy user writes, at its best: float32, in place.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.opencl import Device
from cosim.viform import words_for
from sensor import CHIPS, EFFECTS, make_pixels
from sensor.effects import SHOT_NOISE
from sensor.pixel.fixed_point import to_fixed
from sensor.pixel.model import ExactModel, Span

__all__ = ["PARTS", "Row", "bench"]

CYCLES = 512
PLAIN_CYCLES = 8
REPEATS = 5
THRESHOLD = 1000.0
DARK, BRIGHT = 0.03, 0.6
"""Spikes a cycle at the darkest and brightest pixel of the bench's picture."""
REAL_TIME = 40e3
"""Latch cycles a second of SpikeTwo."""


@dataclass(frozen=True)
class Row:
    """One benchmark; value in unit, realtime 1 = real time."""

    name: str
    tier: str
    value: float
    unit: str
    realtime: float | None
    ceiling_ratio: float | None
    plain_ratio: float | None


def _least(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of repeated calls, the first one discarded."""
    call()
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begin)
    return min(spent)


def _ceiling(device: Device, n: int) -> float:
    """Pixel-cycles a second of the least work there is for a spike bit."""
    source = (files("sensor.pixel") / "ceiling.cl").read_text()
    kernel = device.kernel(source, "ceiling", ("-cl-std=CL1.2",))
    padded, n_words = -(-n // 16) * 16, words_for(CYCLES)
    phase, add = (
        device.upload(np.arange(padded, dtype=np.uint32) * k) for k in (2654435761, 40503)
    )
    words = device.upload(np.zeros((n_words, padded), np.uint32))

    def call() -> None:
        kernel(device.queue, (padded // 16,), None, phase, add, words, np.uint32(n_words))
        device.finish()

    return n * CYCLES / _least(call)


def _rates(n: int) -> npt.NDArray[np.float64]:
    """A picture without edges: every brightness from dark to bright, neighbours alike."""
    return np.linspace(DARK, BRIGHT, n)


def _exact(device: Device | None, n: int, *, noise: bool, ramp: bool) -> float:
    """Pixel-cycles a second of the exact tier, words brought back to the host."""
    effects = tuple(e for e in EFFECTS.values() if noise or e is not SHOT_NOISE)
    pixels = make_pixels(ExactModel(THRESHOLD, 1, effects), np.arange(n, dtype=np.uint32), device)
    charge = to_fixed(_rates(n) * THRESHOLD)
    slope = charge // (2 * CYCLES) if ramp else None
    spans = [Span(0, CYCLES, charge, slope)]
    return n * CYCLES / _least(lambda: pixels.expose(spans, CYCLES))


def _plain(n: int, *, noise: bool, ramp: bool) -> float:
    """Pixel-cycles a second of the same in numpy: float32 charge, a flag array a cycle."""
    mean = (_rates(n) * THRESHOLD).astype(np.float32)
    slope = mean / (2 * CYCLES)
    charge, fired = np.zeros(n, np.float32), np.empty((PLAIN_CYCLES, n), np.bool_)
    random = np.random.default_rng(1)

    def call() -> None:
        add = mean.copy()
        for cycle in range(PLAIN_CYCLES):
            np.add(charge, random.poisson(add) if noise else add, out=charge, casting="unsafe")
            np.greater_equal(charge, THRESHOLD, out=fired[cycle])
            np.subtract(charge, THRESHOLD, out=charge, where=fired[cycle])
            if ramp:
                np.add(add, slope, out=add)

    return n * PLAIN_CYCLES / _least(call, 3)


def _sensor(device: Device | None, ceiling: float | None) -> list[Row]:
    chip = CHIPS["spiketwo"]
    n = chip.width * chip.height
    rows = []
    for name, noise, ramp in (
        ("static", False, False),
        ("ramp", False, True),
        ("noise", True, False),
    ):
        value = _exact(device, n, noise=noise, ramp=ramp)
        plain = _plain(n, noise=noise, ramp=ramp)
        rows.append(
            Row(
                f"sensor.{name}", "exact", value, "pixel-cycles/s", value / (n * REAL_TIME),
                value / ceiling if ceiling else None, value / plain,
            )
        )  # fmt: skip
    return rows


PARTS = {"sensor": _sensor}
"""Parts that have a benchmark."""


def bench(device: Device | None, parts: list[str]) -> dict[str, Any]:
    """The document of `viform bench --json`; the ceiling is null without an OpenCL device."""
    chip = CHIPS["spiketwo"]
    ceiling = _ceiling(device, chip.width * chip.height) if device is not None else None
    rows = [row for part in parts for row in PARTS[part](device, ceiling)]
    return {
        "device": device.name if device is not None else "numba on this processor",
        "ceiling": {
            "value": ceiling,
            "unit": "pixel-cycles/s",
            "what": "one 32-bit addition and the packing of its carry a pixel-cycle",
        },
        "rows": [asdict(row) for row in rows],
    }
