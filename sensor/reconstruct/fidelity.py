"""Fidelity: how near an image comes to the scene's truth. Says how good the camera is, not how
good the simulation is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock, Plane, SpikeStream
from cosim.light.source import Source
from cosim.light.ssim import Likeness, inside
from cosim.run.result import Latency, Metric
from sensor import interval_rate, isi, tfp

__all__ = [
    "METHODS", "Estimate", "Imaged", "Shot", "interval_latency", "judge", "psnr", "spike_rate",
    "ssim", "take_shots", "to_white",
]  # fmt: skip

METHODS = ("tfp", "tfi")
"""Estimates of a synchronous run."""
LEAST_RATE = 1e-30
"""Spikes a cycle below which white counts as this much: smaller numbers leave float32."""


Estimate = npt.NDArray[np.float64]


class Imaged(Protocol):
    """One instant: its cycle, its true reflectance, and an estimate under each method's name."""

    @property
    def cycle(self) -> int: ...
    @property
    def truth(self) -> Plane: ...


@dataclass(frozen=True, eq=False)
class Shot:
    """One instant: cycle, true reflectance, and the estimates of it, white = 1, (H, W).

    tau: cycles of the interval that holds the instant, (H, W) int64, 0 where there is none.
    """

    cycle: int
    truth: Plane
    tfp: Estimate
    tfi: Estimate
    tau: npt.NDArray[np.int64]


def to_white(rate: npt.NDArray[np.floating[Any]], white_rate: float) -> Estimate:
    """Linear estimate of reflectance: spikes a cycle, scaled so that white = 1, in [0, 1].

    In float64, so that a picture of it is the one `viform image --scale WHITE_RATE` makes: 1/2 a
    cycle at 0.6 is 212.5 of 255, and float32 would fall to the other side of it.
    """
    return np.clip(rate.astype(np.float64) / max(white_rate, LEAST_RATE), 0, 1)


def psnr(image: Estimate, truth: Plane) -> float:
    """Peak signal to noise ratio in dB, peak 1; infinite where they agree."""
    error = float(np.mean((image.astype(np.float64) - truth) ** 2))
    return -10 * math.log10(error) if error > 0 else math.inf


def ssim(image: Estimate, truth: Plane) -> float:
    """Structural similarity with the constants and the 11 x 11 Gaussian window (sigma 1.5) of Wang
    et al., IEEE Trans. Image Process. 13:600, 2004; peak 1. NaN for images under 11 x 11."""
    if min(image.shape) < 11:
        return math.nan
    return float(inside(Likeness(truth).map(image)).mean(dtype=np.float64))


def take_shots(
    stream: SpikeStream, source: Source, instants: list[int], window: int, white_rate: float
) -> list[Shot]:
    """What the images of these cycles show, and what was there in the middle of each cycle."""
    shots = []
    for cycle in instants:
        tau = isi(stream, cycle)
        truth = source.truth(stream.clock.middle(cycle))
        mean = to_white(tfp(stream, cycle, window), white_rate)
        shots.append(Shot(cycle, truth, mean, to_white(interval_rate(tau), white_rate), tau))
    return shots


def judge(shots: Sequence[Imaged], methods: Sequence[str] = METHODS) -> dict[str, Metric]:
    """PSNR and SSIM of each method, mean over the instants."""
    means = {}
    for method in methods:
        pairs = [(getattr(shot, method), shot.truth) for shot in shots]
        means[f"{method}_psnr"] = Metric(float(np.mean([psnr(*pair) for pair in pairs])), "dB")
        means[f"{method}_ssim"] = Metric(float(np.mean([ssim(*pair) for pair in pairs])), "1")
    return means


def interval_latency(clock: Clock, shots: list[Shot]) -> list[Latency]:
    """How long the interval that tells a pixel's light is: over pixels and instants."""
    tau = np.concatenate([shot.tau.ravel() for shot in shots])
    tau = tau[tau > 0]
    if tau.size == 0:
        return []
    us = 1e6 / clock.hz
    least, median, most = (float(x * us) for x in (tau.min(), np.median(tau), tau.max()))
    return [Latency("interval", least, median, most)]


def spike_rate(stream: SpikeStream) -> float:
    """Spikes a pixel and cycle, over the whole stream."""
    chunk, words = 2, -(-stream.cycles // 32)
    total = sum(
        int(np.bitwise_count(stream.read_words(w, w + chunk)).sum(dtype=np.int64))
        for w in range(0, words, chunk)
    )
    return total / (stream.cycles * stream.shape[0] * stream.shape[1])
