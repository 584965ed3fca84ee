"""How far a link's design is from what its light, its pixels and its ticks could carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from link.layout import Layout
from link.mode import Mode
from link.theory import Reset, count_capacity, count_laws, one_bit_capacity, poisson_capacity

__all__ = ["Given", "capacity_bps", "capacity_document", "pixel_bound"]

WORD: Final = 255
LARGEST: Final = 1000.0
"""Thresholds above it are scaled down to it, means with them, for what follows single electrons."""


@dataclass(frozen=True)
class Given:
    """on, off: mean electrons of a tick of a pixel in the middle of cells that are on and off.
    threshold: electrons. hz: ticks a second. sensor: pixels of it. seen: of them, on the panel's
    image. looks: camera pixels to a cell, whole ones that see nothing else, at least 1."""

    on: float
    off: float
    threshold: float
    reset: Reset
    hz: float
    sensor: int
    seen: float
    looks: int


def pixel_bound(given: Given) -> float:
    """Bits a tick that no modulation of one pixel's light can exceed: what a latch can say, or what
    light of this peak and background could carry where that is less."""
    peak = max(given.on - given.off, 1e-300)
    return min(1.0, float(poisson_capacity(given.off / peak)) * peak)


def capacity_bps(given: Given) -> float:
    """Of all camera pixels that see the panel, each at its `pixel_bound`: bits a second."""
    return given.seen * given.hz * pixel_bound(given)


def _pixel(given: Given, mode: Mode, seed: int) -> dict[str, Any]:
    """What a pixel can tell in a tick, and a cell in a symbol, bits."""
    from link.theory.information import fsc_information_rate

    on, off, q = given.on, given.off, given.threshold
    peak, scale = max(on - off, 1e-300), max(given.threshold / LARGEST, 1.0)
    whole = max(round(q / scale), 1)
    ticks = 12_800 if whole <= 200 else 1_600
    rate = fsc_information_rate(
        given.reset, whole, on / scale, off / scale, ticks=ticks, seed=seed
    )  # fmt: skip
    off_law, on_law = count_laws(q, on, off, given.reset, mode.ticks, mode.code.run_limit)
    looks = [off_law, on_law]
    for bit, law in enumerate(looks):
        looks[bit] = _sum_of(law, given.looks)
    cell, share = count_capacity(looks[0], looks[1])
    return {
        "poisson": {
            "value": float(poisson_capacity(off / peak)) * peak, "unit": "bit/tick",
            "what": "light of this peak and background, switched at any speed, every electron seen",
        },
        "one_bit": {"value": 1.0, "unit": "bit/tick", "what": "a latch says one bit a tick"},
        "slot": {
            "value": float(one_bit_capacity(q, on, off)), "unit": "bit/tick",
            "what": "a pixel that begins every tick empty, at its best share of ON",
        },
        "memory": {
            "value": rate.rate, "ci": [rate.low, rate.high], "unit": "bit/tick",
            "ticks": rate.ticks, "threshold": whole,
            "what": f"random bits through a pixel with {given.reset} reset, Arnold and Loeliger, "
            "99 % limits",
        },
        "cell": {
            "value": cell, "share_on": share, "looks": given.looks * mode.ticks,
            "unit": "bit/symbol",
            "what": "the count of spikes of a cell's pixels in a symbol's ticks, at its best share "
            "of ON, pixels independent",
        },
    }  # fmt: skip


def _sum_of(law: Any, looks: int) -> Any:
    import numpy as np

    out = np.ones(1)
    for _ in range(looks):
        out = np.convolve(out, law)
    return out


def capacity_document(given: Given, mode: Mode, seed: int = 1) -> dict[str, Any]:
    """{capacity_bps, raw_bps, coded_bps, share, pixel, budget, given, mode}.

    capacity_bps: of all camera pixels that see the panel, each at the strict bound of its own: one
    bit a tick, or what its light could carry where that is less. budget: from every pixel of the
    sensor at one bit a tick to the coded rate, each row with its factor, the rate that is left
    after it, and the share of all lost octaves that it costs.
    """
    import math

    layout = Layout(mode)
    pixel = _pixel(given, mode, seed)
    per_tick = pixel_bound(given)
    rows, columns = layout.shape
    cells, free = rows * columns, int(layout.free.sum())
    line = mode.code.bits / layout.group
    factors = [
        ("view", "camera pixels that see the panel", given.seen / given.sensor),
        ("light", "bits that a tick's electrons can carry, at most 1", per_tick),
        ("cell", f"camera pixels to a cell of {mode.cell} x {mode.cell} panel pixels",
         cells / given.seen),
        ("ticks", "ticks to a symbol", 1 / mode.ticks),
        ("tags", "cells under the four tags", free / cells),
        ("pilots", "cells that are pilots", layout.cells / free),
        ("line code", f"{mode.code.bits} bits in {layout.group} symbols", line),
        ("Reed-Solomon", f"{WORD - mode.parity} of {WORD} bytes", (WORD - mode.parity) / WORD),
    ]  # fmt: skip
    rate = given.sensor * given.hz
    lost = sum(math.log(f) for _, _, f in factors if 0 < f < 1)
    budget: list[dict[str, Any]] = [
        {"name": "sensor", "what": "every pixel, one bit a tick", "factor": 1.0, "bps": rate,
         "share_of_loss": 0.0},
    ]  # fmt: skip
    for name, what, factor in factors:
        rate *= factor
        cost = math.log(factor) / lost if 0 < factor < 1 and lost else 0.0
        budget.append(
            {"name": name, "what": what, "factor": factor, "bps": rate, "share_of_loss": cost}
        )
    raw = layout.cells * given.hz / mode.ticks
    capacity = capacity_bps(given)
    return {
        "capacity_bps": capacity,
        "cells_bps": layout.cells * given.hz / mode.ticks * pixel["cell"]["value"],
        "raw_bps": raw, "coded_bps": raw * line * (WORD - mode.parity) / WORD,
        "share": raw * line * (WORD - mode.parity) / WORD / capacity if capacity else None,
        "pixel": pixel, "budget": budget,
        "given": {
            "on": given.on, "off": given.off, "threshold": given.threshold, "reset": given.reset,
            "hz": given.hz, "sensor": given.sensor, "seen": given.seen, "looks": given.looks,
        },
        "mode": {
            "width": mode.width, "height": mode.height, "cell": mode.cell, "ticks": mode.ticks,
            "line": mode.line, "parity": mode.parity,
        },
    }  # fmt: skip
