"""The light and the cameras of a comparison of motion."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Final

from cosim import Clock, InputError
from sensor import CHIPS, EFFECTS, CameraSetting

CLOCK: Final = Clock(40_000)


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
