"""Images of a latched stream at chosen instants, with the truth of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, Plane, SpikeStream
from cosim.light.source import Source
from cosim.report.png import write_linear_png
from cosim.run.result import Latency
from sensor.reconstruct.fidelity import Estimate, Imaged, to_white
from sensor.reconstruct.intervals import interval_rate, isi
from sensor.reconstruct.playback import tfp

__all__ = [
    "LATCHED", "Shot", "interval_latency", "spike_rate", "take_shots", "write_images",
]  # fmt: skip

LATCHED: Final = ("tfp", "tfi")
"""Estimates of a latched stream."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One instant.

    Attributes:
        cycle: of the instant.
        truth: reflectance, white = 1, (H, W).
        tfp, tfi: its estimates.
        tau: length of the interval that holds the instant, cycles, (H, W) int64; 0 for none.
    """

    cycle: int
    truth: Plane
    tfp: Estimate
    tfi: Estimate
    tau: npt.NDArray[np.int64]


def take_shots(
    stream: SpikeStream, source: Source, instants: list[int], window: int, white_rate: float
) -> list[Shot]:
    """Images of these cycles, with the truth in the middle of each."""
    shots = []
    for cycle in instants:
        tau = isi(stream, cycle)
        truth = source.truth(stream.clock.middle(cycle))
        mean = to_white(tfp(stream, cycle, window), white_rate)
        shots.append(Shot(cycle, truth, mean, to_white(interval_rate(tau), white_rate), tau))
    return shots


def write_images(folder: Path, shots: Sequence[Imaged], methods: Sequence[str]) -> list[str]:
    """Writes truth and estimates of each instant, linear, 8-bit grey; their names in the folder."""
    if shots:
        (folder / "images").mkdir(exist_ok=True)
    names = []
    for shot in shots:
        for method in ("truth", *methods):
            names.append(f"images/{method}-{shot.cycle:05d}.png")
            write_linear_png(folder / names[-1], getattr(shot, method))
    return names


def interval_latency(clock: Clock, shots: list[Shot]) -> list[Latency]:
    """Length of the interval that an estimate is made from, over pixels and instants."""
    tau = np.concatenate([shot.tau.ravel() for shot in shots])
    tau = tau[tau > 0]
    if tau.size == 0:
        return []
    us = 1e6 / clock.hz
    least, median, most = (float(x * us) for x in (tau.min(), np.median(tau), tau.max()))
    return [Latency("interval", least, median, most)]


def spike_rate(stream: SpikeStream) -> float:
    """Spikes per pixel and cycle, over the whole stream."""
    chunk, words = 2, -(-stream.cycles // 32)
    total = sum(
        int(np.bitwise_count(stream.read_words(w, w + chunk)).sum(dtype=np.int64))
        for w in range(0, words, chunk)
    )
    return total / (stream.cycles * stream.shape[0] * stream.shape[1])
