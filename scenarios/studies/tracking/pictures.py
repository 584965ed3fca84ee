"""The pictures of a moving scene that a tracker gets: spikes counted in blocks, or frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.spikes.viform import WORD, count_spikes
from scenarios.scenes.moving import ExposedScene, ExposedSource
from scenarios.studies.tracking.conditions import Conditions
from sensor import SpikeCamera

STEP = 64
"""Cycles that are simulated at once."""


@dataclass(frozen=True, eq=False)
class Picture:
    """An estimate of reflectance.

    Attributes:
        start, stop: limits of the picture's exposure, s.
        ready: instant at which its last pixel has left the camera, s.
        values: (H, W) float32, white = 1.
    """

    start: float
    stop: float
    ready: float
    values: npt.NDArray[np.float32]

    @property
    def middle(self) -> float:
        """Middle of the exposure, s."""
        return (self.start + self.stop) / 2


def spike_pictures(
    scene: ExposedScene, conditions: Conditions, seed: int, block: int | None = None
) -> Iterator[Picture]:
    """Spikes of the simulated camera, counted in blocks of cycles one after another, without end.
    A plane is read in the cycle after it.

    Args:
        block: cycles of a picture, a divisor of 64; that of the conditions if None.
    """
    setting, clock = conditions.camera(seed), conditions.clock
    every = conditions.block if block is None else block
    camera = SpikeCamera(setting, None)
    source = ExposedSource(scene, conditions.illuminance(setting), clock, STEP)
    scale = np.float32(every * conditions.white)
    cycle = 0
    while True:
        part = Block(cycle, STEP)
        stream = camera.step(source.step(None, part), part)
        assert STEP % WORD == 0
        for first in range(0, STEP, every):
            start, stop = ((cycle + first + n) / clock.hz for n in (0, every))
            counts = count_spikes(stream, first, first + every)
            yield Picture(start, stop, stop + 1 / clock.hz, counts.astype(np.float32) / scale)
        cycle += STEP


def frame_pictures(
    scene: ExposedScene, conditions: Conditions, seed: int, rate: float
) -> Iterator[Picture]:
    """Frames of an ideal camera with a global shutter, without end: the exposure is the whole frame
    time, the frame is read in the next one, and the only noise is that of the electrons (Poisson);
    its pixels do not saturate and add nothing at readout.

    Args:
        rate: frames/s.
    """
    random = np.random.Generator(np.random.Philox(key=seed))
    white, frame = conditions.electrons / rate, 0
    while True:
        start, stop = frame / rate, (frame + 1) / rate
        electrons = scene.mean(start, stop) * white
        if conditions.shot_noise:
            electrons = random.poisson(electrons).astype(np.float64)
        yield Picture(start, stop, stop + 1 / rate, (electrons / white).astype(np.float32))
        frame += 1
