"""A small imager with everything in closed form: linear pixels, a rolling shutter, a controller
that halves its exposure when a frame is too bright. For tests of what is common to imagers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cosim.compute.draws import normal, poisson
from cosim.compute.streams import Stream
from cosim.frames import Frame
from cosim.plan.effects import Bound, Effect
from cosim.run.result import Latency, Metric
from imagers.common.kind import ImagerKind, ImagerSection
from imagers.common.model import ExposureRange, ImagerModel
from sensor.frame_pixels import Exposed, ImagerSummary

ELECTRONS = 2000.0
"""Photoelectrons in one lux second."""
READ = 3.0
SLOPE = 0.02
"""Share of the signal that the pattern adds, standard deviation."""
FRAME = 10_000_000_000
"""ps"""


def _effect(name, stream, bound, cost):
    return Effect(name, "closed form", stream, bound, lambda _: cost)


class LinearPixels:
    """DN = electrons + 20, 12 bits."""

    def __init__(self, shape):
        self.shape, self.bits = shape, 12
        self.calls = 0
        rows = (
            _effect("shot noise", Stream.IMAGER_SHOT, lambda s: Bound(
                1 - np.sqrt(READ**2 / (READ**2 + s.brightest)), "proof"), 50.0),
            _effect("read noise", Stream.IMAGER_READ, lambda s: Bound(
                1 - np.sqrt(s.darkest / (READ**2 + s.darkest)), "proof"), 60.0),
            _effect("PRNU", Stream.IMAGER_PATTERN, lambda s: Bound(SLOPE, "proof"), 70.0),
            _effect("leak", Stream.NONE, lambda s: Bound(1e-5, "proof"), 10.0),
        )  # fmt: skip
        self.effects = {e.name: e for e in rows}

    def convert(self, rows, seed, kept):
        self.calls += 1
        count, width = rows.lux_seconds.shape
        numbers = np.arange(rows.first * width, (rows.first + count) * width).reshape(count, width)
        signal = rows.lux_seconds * ELECTRONS
        if "PRNU" in kept:
            signal = signal * (1 + SLOPE * normal(numbers, 1, 1, Stream.IMAGER_PATTERN))
        if "leak" in kept:
            signal = signal * (1 - 1e-5)
        if "shot noise" in kept:
            signal = poisson(signal, numbers, rows.frame, seed, Stream.IMAGER_SHOT).astype(float)
        if "read noise" in kept:
            signal = signal + READ * normal(numbers, rows.frame, seed, Stream.IMAGER_READ)
        return np.clip(np.rint(signal + 20), 0, 4095).astype(np.uint16)

    def mean_variance(self, lux_seconds, seconds):
        mean = lux_seconds * ELECTRONS
        return mean + 20, mean + READ**2 + 1 / 12

    def summary(self, lux_seconds, seconds, frames):
        low, high = (v * ELECTRONS for v in lux_seconds)
        return ImagerSummary(low, high, 4095.0, frames, frames, exposure=seconds)


class LinearImager:
    """Exposes for `exposure` ps before each row's readout; halves it where the frame's mean is over
    2000 DN, from the next frame on."""

    name = "linear"

    def __init__(self, shape, exposure, broken=None):
        self.pixels = LinearPixels(shape)
        self.exposure, self.broken, self.now = exposure, broken, 0

    def write(self, register, value, at=None):
        self.exposure = value

    def read(self, register):
        return self.exposure

    def film(self, scene, until, *, seed, kept, trace=None):
        rows = self.pixels.shape[0]
        number = 0
        while (number + 1) * FRAME <= until:
            if number == self.broken:
                raise KeyboardInterrupt
            end = number * FRAME + FRAME // 2 + np.arange(rows, dtype=np.int64) * 1_000_000
            begin = end - self.exposure
            light = scene.lux_seconds(0, begin, end)
            seconds = np.full(rows, self.exposure * 1e-12)
            given = Exposed(light, seconds, np.zeros(rows), 0, number)
            values = self.pixels.convert(given, seed, kept)
            state = {"exposure": float(self.exposure)}
            yield Frame(values, 12, number, begin, end, (number + 1) * FRAME, state)
            if values.mean() > 2000:
                self.exposure //= 2
            number += 1


@dataclass
class LinearModel(ImagerModel):
    shape: tuple = (24, 32)
    exposure: int = FRAME // 4
    broken: int | None = None
    made: list = field(default_factory=list)

    def make(self):
        self.made.append(LinearImager(self.shape, self.exposure, self.broken))
        return self.made[-1]

    def exposures(self, view, stop):
        seconds = self.exposure * 1e-12
        light = float(view.least.min()) * seconds, float(view.most.max()) * seconds
        return ExposureRange(light, (seconds, seconds), stop // FRAME)

    def metrics(self, frames, view, imager):
        return {"mean": Metric(frames[-1].mean, "DN")}

    def latency(self, frames, view, imager):
        return [Latency("exposure", 1.0, 1.0, 1.0)]


class LinearSection(ImagerSection):
    kind: Literal["linear"]


class LinearKind(ImagerKind):
    """Gives the model that a test has put in its place."""

    name, title, section = "linear", "linear imager", LinearSection

    def __init__(self):
        self.next = LinearModel()

    def model(self, section, seconds):
        return self.next
