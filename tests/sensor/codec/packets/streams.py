"""Random and extreme streams for the tests of the packets."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import Words, pack_planes


def steady(
    rate: npt.ArrayLike, phase: npt.ArrayLike, cycles: int, noise: float = 0.0, seed: int = 0
) -> Words:
    """Words (n, H, W) of pixels that carry their residual. rate: spikes a cycle, (H, W) phase.

    noise: standard deviation of what each cycle adds, in parts of its light.
    """
    rate, phase = np.broadcast_arrays(np.asarray(rate, float), np.asarray(phase, float))
    rng = np.random.default_rng(seed)
    light = rate[None] * (1 + noise * rng.standard_normal((cycles, *rate.shape)))
    charge = np.floor(np.cumsum(light, axis=0) + phase)
    planes = np.diff(charge, axis=0, prepend=np.floor(phase)[None]) > 0
    return pack_planes(planes)


def random_stream(seed: int) -> tuple[Words, int]:
    """(words, cycles) of one of many kinds: dark, every cycle, noise, trains, one pixel, edges."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 21, 2) if seed % 7 else (1, 1)
    cycles = int(rng.integers(1, 513))
    shape, kind = (cycles, height, width), seed % 6
    if kind == 0:
        planes = np.full(shape, seed % 12 == 0)
    elif kind == 1:
        planes = rng.random(shape) < rng.random()
    elif kind == 2:
        planes = rng.random(shape) < rng.random((height, width)) ** 4
    elif kind == 3:
        planes = np.zeros(shape, bool)
        planes[rng.integers(cycles), rng.integers(height), rng.integers(width)] = True
    elif kind == 4:  # dark, then every cycle
        planes = np.arange(cycles)[:, None, None] >= rng.integers(0, cycles + 1, (height, width))
    else:
        rate = rng.random((height, width)) * rng.random()
        return steady(rate, rng.random((height, width)), cycles, 0.3 * rng.random(), seed), cycles
    return pack_planes(planes), cycles
