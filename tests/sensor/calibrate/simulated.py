"""Recordings of simulated cameras with random true parameters, by the exact tier."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim import Block, Clock, Light, Piece
from cosim.spikes.viform import Viform
from sensor.device.chips import CHIPS
from sensor.device.pattern import DevicePattern
from sensor.latched.camera import SpikeCamera
from sensor.latched.setting import CameraSetting

CLOCK = Clock(40_000)


@dataclass(frozen=True)
class Truth:
    """True parameters of a camera; charges over the threshold."""

    threshold: float
    threshold_noise: float
    pattern: DevicePattern
    dead_time: float
    shape: tuple[int, int] = (48, 64)

    @property
    def interval_noise(self) -> float:
        return float(np.sqrt(1 / self.threshold + (self.threshold_noise / self.threshold) ** 2))

    @property
    def values(self) -> dict[str, float]:
        """By the names of the calibration's parameters."""
        p = self.pattern
        return {
            "interval_noise": self.interval_noise, "dark_current": p.dark / self.threshold,
            "dsnu": p.dsnu, "prnu": p.prnu, "threshold_fpn": p.threshold_fpn,
            "hot_pixels": p.hot, "hot_current": p.hot_current / self.threshold,
            "dead_pixels": p.dead, "dead_time": self.dead_time,
        }  # fmt: skip

    def setting(self, seed: int, **changed: object) -> CameraSetting:
        chip = replace(CHIPS["spiketwo"], height=self.shape[0], width=self.shape[1])
        return CameraSetting(
            chip, CLOCK, self.threshold, seed, pattern=self.pattern,
            threshold_noise=self.threshold_noise, dead_time=self.dead_time, **changed,
        )  # fmt: skip

    def record(self, rate: float, cycles: int, seed: int, **changed: object) -> Viform:
        """A recording of constant light that lets a perfect pixel fire `rate` times a cycle."""
        setting = self.setting(seed, **changed)
        lux = rate / setting.rate(1.0) if rate else 0.0
        return film(setting, np.full(self.shape, lux, np.float32), cycles)


def film(setting: CameraSetting, lux: np.ndarray, cycles: int) -> Viform:
    """A recording of constant light, (H, W) lux."""
    light = Light((Piece(0, 2**62, lux, lux),))
    camera = SpikeCamera(setting, None)
    words = camera.step(light, Block(0, cycles)).words
    return Viform(words, cycles, CLOCK)


def draw_camera(seed: int) -> Truth:
    """A camera with random true parameters."""
    rng = np.random.default_rng([2026, seed])
    threshold = float(np.exp(rng.uniform(np.log(300), np.log(30_000))))
    dark = threshold * 40e3 * float(np.exp(rng.uniform(np.log(4e-4), np.log(2e-2))))
    return Truth(
        threshold,
        threshold * float(rng.uniform(0.0, 0.02)),
        DevicePattern(
            prnu=float(rng.uniform(0.01, 0.05)), dark=dark, dsnu=float(rng.uniform(0.03, 0.25)),
            threshold_fpn=float(rng.uniform(0.005, 0.04)),
            hot=float(rng.uniform(0.002, 0.01)), hot_current=dark * float(rng.uniform(5, 15)),
            dead=float(rng.uniform(0.001, 0.01)), device_seed=seed,
        ),
        float(rng.uniform(0.0, 2e-6)),
    )  # fmt: skip
