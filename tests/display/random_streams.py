"""Random spike streams of a tile, with the summary that a plan reads of their light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Clock, Summary
from cosim.spikes.viform import pack_planes
from display import CameraPlane, DisplaySetting, FixedEye, PursuingEye, SpikePanel
from display.drives import DRIVES
from display.observe.views import Observer

CLOCK = Clock(40_000)
TILE = 16
HEIGHT = 160
"""Rows of the panel that the tile lies in."""


@dataclass(frozen=True, eq=False)
class Stream:
    """words: (words, pixels) of `planes` planes. row: (TILE,) the panel's row of each of its."""

    setting: DisplaySetting
    words: npt.NDArray[np.uint32]
    planes: int
    row: npt.NDArray[np.int64]
    summary: Summary


def fired(rate: npt.NDArray[np.float64], noise: float, rng: np.random.Generator) -> npt.NDArray:
    """(planes, H, W) spikes of pixels that gather `rate` thresholds a plane and carry on what is
    over; thresholds vary by `noise`."""
    shape = rate.shape[1:]

    def drawn() -> npt.NDArray[np.float64]:
        return np.asarray(rng.gamma(1 / noise**2, noise**2, shape)) if noise else np.ones(shape)

    lacks, spikes = drawn() * rng.random(shape), np.zeros(rate.shape, np.bool_)
    for n, light in enumerate(rate):
        lacks -= light
        spikes[n] = lacks <= 0
        if spikes[n].any():
            lacks = np.where(spikes[n], np.maximum(lacks + drawn(), 0), lacks)
    return spikes


def random_stream(seed: int) -> Stream:
    """Any drive, observer, emitter and light: dark to bright, even or textured, still or moving."""
    rng = np.random.default_rng(seed)

    def some(low: float, high: float, chance: float) -> float:
        """Nothing, or a size from low to high, evenly in its logarithm."""
        return float(10 ** rng.uniform(np.log10(low), np.log10(high))) * (rng.random() < chance)

    planes = int(rng.integers(200, 1000))
    panel = SpikePanel(
        (HEIGHT, TILE), CLOCK, float(rng.uniform(0.2, 1)), list(DRIVES)[int(rng.integers(3))],
        float(rng.choice([1.0, 0.2])), some(1e-7, 1e-5, 0.4), some(1e-7, 1e-4, 0.4),
        transport=1_000_000,
    )  # fmt: skip
    instants = tuple(panel.start(int(n)) for n in rng.integers(planes // 4, planes, 2))
    still: FixedEye | CameraPlane = CameraPlane(instants, round(10 ** rng.uniform(7.5, 10)))
    if rng.random() < 0.5:
        still = FixedEye(instants, 300.0, panel.start(0), panel.start(planes))
    observer: Observer = still
    if rng.random() < 0.5:
        observer = PursuingEye(still, (0.0, float(10 ** rng.uniform(0, 4))))
    mean, depth = 10 ** rng.uniform(-2, 0), rng.choice([0.0, rng.random()])
    speed = some(1e1, 1e4, 0.5)  # pixels a second
    y, x = np.mgrid[:TILE, :TILE]
    time = np.arange(planes)[:, None, None] / CLOCK.hz
    wave = 2 * np.pi / TILE * (rng.uniform(0, 8) * (x - speed * time) + rng.uniform(0, 8) * y)
    rate = np.minimum(mean / (1 + depth) * (1 + depth * np.sin(wave)), 1.0)
    q, noise = 1000.0, some(0.005, 0.5, 0.7)
    spikes = fired(rate, noise, rng)
    summary = Summary(
        np.array([rate.min() * q]), np.array([rate.max() * q]), q, 41, planes, 1 / 41, noise,
        np.array([1.0 if speed and depth else 0.0]),
    )  # fmt: skip
    words = pack_planes(spikes).reshape(-1, TILE * TILE)
    row = int(rng.integers(HEIGHT - TILE)) + np.arange(TILE)
    return Stream(DisplaySetting(panel, observer), words, planes, row, summary)
