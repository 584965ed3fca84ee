"""Spike cameras that the laboratory measures, each with its bench; other cameras bring their own.

Each is a part of its chip, large enough for spatial variances of some per cent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from sensor.laboratory.bench import Bench
from sensor.laboratory.spiking import SpikeCounter, silicon_setting


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


def _spiking(chip: str) -> Callable[[int], Bench]:
    """1000 electrons per spike, an exposure of 2000 cycles."""

    def bench(seed: int) -> Bench:
        setting, seconds = silicon_setting(chip, (16, 64), 1000.0), 0.05
        return Bench(
            SpikeCounter(setting, seconds), setting.chip.pixel_area, seconds, (0.05, 0.25, 0.5),
            rows=16, levels=10, frames=6, stack=24, seed=seed, bias=2.5e5, dark_bias=0.0,
        )  # fmt: skip

    return bench


_COUNTS = (
    "the digital number is the number of spikes in an exposure of 50 ms; a spike is 1000 electrons",
    "imperfections of the preset silicon, assumed; defect pixels are left out",
    "dark current and DSNU are measured without the bias; the variance there is that of counting, "
    "so mu_I,var is no dark current",
    "the exposure begins at any instant between two spikes: of the dark noise, 1/6 DN^2 is the "
    "count's error at both ends of the exposure",
)
SPIKE_CAMERAS: Final = {
    camera.name: camera
    for camera in (
        Camera("spiketwo", "SpikeTwo (2021)", _spiking("spiketwo"), _COUNTS),
        Camera("spikeone", "SpikeOne (2017)", _spiking("spikeone"), _COUNTS),
    )
}  # fmt: skip
"""Cameras by name."""
