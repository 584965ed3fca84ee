"""What a tracker gets in a comparison of motion: the light, the cameras, and pictures of the moving
scene, of spikes counted in blocks or of frames."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, InputError
from cosim.spikes.viform import WORD, count_spikes
from scenarios.scenes.moving import ExposedScene, ExposedSource
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera

CLOCK: Final = Clock(40_000)
STEP = 64
"""Cycles that are simulated at once."""


@dataclass(frozen=True)
class Conditions:
    """What all measurements share.

    Attributes:
        speeds: speeds of the motion, pixels/s, in rising order.
        frame_rates: frame rates of the cameras with frames, 1/s.
        trials: number of repetitions with other phases, places and noise.
        seed: seed of all random numbers.
        white: spikes a cycle of reflectance 1.
        shape: (rows, columns) of every camera.
        clock: clock of the spike camera.
        threshold: threshold of the spike camera, electrons.
        block: cycles in which the spikes of a picture are counted, a divisor of 64.
        shot_noise: whether there is shot noise.
    """

    speeds: tuple[float, ...] = (1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5)
    frame_rates: tuple[float, ...] = (60.0, 240.0, 1000.0)
    trials: int = 10
    seed: int = 1
    white: float = 0.6
    shape: tuple[int, int] = (96, 128)
    clock: Clock = CLOCK
    threshold: float = 1000.0
    block: int = 8
    shot_noise: bool = True

    def __post_init__(self) -> None:
        hz = self.clock.hz
        for name, values, unit, least, most in (
            ("--speeds", self.speeds, "px/ms", 10.0, 1e6),
            ("--frame-rates", self.frame_rates, "frames/s", 30.0, hz / 4),
        ):
            scale = 1e3 if unit == "px/ms" else 1.0
            if not values:
                raise InputError(name, "one or more numbers", "none", "give one")
            for value in values:
                if not (math.isfinite(value) and least <= value <= most):
                    raise InputError(
                        name, f"{least / scale:g} to {most / scale:g} {unit}", f"{value / scale:g}",
                        f"write {(most if value > most else least) / scale:g}",
                    )  # fmt: skip
            if len(set(values)) != len(values):
                raise InputError(name, "different numbers", "one twice", "leave it out")
        for name, number, low, high in (
            ("--trials", self.trials, 1, 1000), ("--seed", self.seed, 0, 2**32 - 1),
            ("--white", self.white, 0.01, 1.0),
        ):  # fmt: skip
            if not low <= number <= high:
                raise InputError(
                    name,
                    f"{low:g} to {high:g}",
                    f"{number:g}",
                    f"write {high if number > high else low:g}",
                )

    @property
    def electrons(self) -> float:
        """Electrons a second of a pixel under reflectance 1, in every camera."""
        return self.white * self.threshold * self.clock.hz

    def camera(self, seed: int) -> CameraSetting:
        """The spike camera: perfect pixels with, or without, shot noise."""
        chip = dataclasses.replace(CHIPS["spikeone"], height=self.shape[0], width=self.shape[1])
        effects = tuple(EFFECTS.values()) if self.shot_noise else ()
        return CameraSetting(chip, self.clock, self.threshold, seed, effects=effects)

    def illuminance(self, setting: CameraSetting) -> float:
        """Illuminance on the pixels of reflectance 1, lux."""
        return self.white / setting.rate(1.0)


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
