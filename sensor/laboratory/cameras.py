"""Spike cameras that the laboratory measures, each with its bench; other cameras bring their own.

Each is a part of its chip, large enough for spatial variances of some per cent. The digital number
of a latched spike camera is the count of spikes in an exposure. An exposure begins at any instant
between two spikes: each frame is a run of its own, with a random phase. The count is then the
number of electrons over the threshold, with the error of both ends of the window, 1/6 DN^2 (two
rounding errors of variance 1/12).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, InputError, Light, Piece
from cosim.compute.opencl import Device, shared_device
from cosim.plan.effects import Effect
from sensor.device.chips import CHIPS
from sensor.device.pattern import DevicePattern
from sensor.frame_pixels import Exposed
from sensor.laboratory.bench import Bench
from sensor.latched.camera import SpikeCamera
from sensor.latched.effects.catalogue import silicon_sizes
from sensor.latched.setting import CameraSetting

_BLOCK = 2048
"""Cycles that are simulated at once."""
_ODD = 2654435761
"""2^32 over the golden ratio, odd: seeds of one run's frames do not meet those of another's."""
_COUNTS = (
    "the digital number is the number of spikes in an exposure of 50 ms; a spike is 1000 electrons",
    "imperfections of the preset silicon, assumed; defect pixels are left out",
    "dark current and DSNU are measured without the bias; the variance there is that of counting, "
    "so mu_I,var is no dark current",
    "the exposure begins at any instant between two spikes: of the dark noise, 1/6 DN^2 is the "
    "count's error at both ends of the exposure",
)


@dataclass(frozen=True)
class Camera:
    """A camera that the laboratory measures.

    Attributes:
        name: name on the command line.
        title: title for people.
        bench: makes its bench from the seed of the temporal noise.
        notes: how its parameters are to be read.
    """

    name: str
    title: str
    bench: Callable[[int], Bench]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class SpikeCounter:
    """Pixels of a spike camera as the bench reads them.

    Attributes:
        setting: setting of the camera; its seed is replaced, frame by frame.
        seconds: usual exposure time, which sets the number of bits, s.
    """

    setting: CameraSetting
    seconds: float

    @cached_property
    def effects(self) -> dict[str, Effect]:
        return {effect.name: effect for effect in self.setting.acting_effects}

    @property
    def shape(self) -> tuple[int, int]:
        return self.setting.chip.height, self.setting.chip.width

    @property
    def bits(self) -> int:
        """Bits of the largest count: one spike in each cycle of the usual exposure."""
        return round(self.seconds * self.setting.clock.hz).bit_length()

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """Spikes of each pixel in the exposure of its row, (rows, W). See `PixelModel`."""
        setting, height = self.setting, rows.lux_seconds.shape[0]
        cycles = round(float(rows.seconds[0]) * setting.clock.hz)
        lux = (rows.lux_seconds / (cycles * float(setting.clock.period))).astype(np.float32)
        light = Light((Piece(0, 2**62, lux, lux),))
        left_out = self.effects.keys() - kept
        setting = replace(setting.without(left_out), seed=(seed * _ODD + rows.frame) % 2**32)
        camera = SpikeCamera(setting, _device(), (rows.first, rows.first + height))
        count = np.zeros(rows.lux_seconds.shape, np.int64)
        for start in range(0, cycles, _BLOCK):
            words = camera.step(light, Block(start, min(_BLOCK, cycles - start))).words
            count += np.bitwise_count(words).sum(axis=0, dtype=np.int64)
        return np.minimum(count, 65535).astype(np.uint16)


def silicon_setting(chip: str, shape: tuple[int, int], threshold: float) -> CameraSetting:
    """A part of a chip with the imperfections of the preset silicon, defect pixels aside.

    Args:
        chip: name of the preset, of `CHIPS`.
        shape: rows and columns.
        threshold: threshold of the charge, electrons.
    """
    part = replace(CHIPS[chip], height=shape[0], width=shape[1])
    silicon = silicon_sizes()
    pattern = DevicePattern(
        prnu=silicon["prnu"], dark=silicon["dark_current"], dsnu=silicon["dsnu"],
        threshold_fpn=silicon["threshold_fpn"],
    )  # fmt: skip
    return CameraSetting(
        part, Clock(40_000), threshold, 1,
        pattern=pattern,
        threshold_noise=silicon["threshold_noise"] * threshold,
        dead_time=silicon["dead_time"],
        row_skew=silicon["row_skew"],
        comparator_delay=silicon["comparator_delay"],
        crosstalk=silicon["crosstalk"],
    )  # fmt: skip


def _device() -> Device | None:
    """The OpenCL device, which gives the bits of the compiled form in a third of its time; None on
    a machine without one."""
    try:
        return shared_device(None)
    except InputError:
        return None


def _spiking(chip: str) -> Callable[[int], Bench]:
    """1000 electrons per spike, an exposure of 2000 cycles."""

    def bench(seed: int) -> Bench:
        setting, seconds = silicon_setting(chip, (16, 64), 1000.0), 0.05
        return Bench(
            SpikeCounter(setting, seconds), setting.chip.pixel_area, seconds, (0.05, 0.25, 0.5),
            rows=16, levels=10, frames=6, stack=24, seed=seed, bias=2.5e5, dark_bias=0.0,
        )  # fmt: skip

    return bench


SPIKE_CAMERAS: Final = {
    camera.name: camera
    for camera in (
        Camera("spiketwo", "SpikeTwo (2021)", _spiking("spiketwo"), _COUNTS),
        Camera("spikeone", "SpikeOne (2017)", _spiking("spikeone"), _COUNTS),
    )
}  # fmt: skip
"""Cameras by name."""
