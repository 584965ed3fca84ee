"""The cameras that the laboratory measures, each with its bench.

Each is a part of its chip, large enough for spatial variances of some per cent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from sensor.imagers.cmos import AdaptivePixels
from sensor.imagers.ebaps import EbapsPixels
from sensor.imagers.emccd import EmccdPixels
from sensor.imagers.emccd.chip import PITCH
from sensor.laboratory.bench import Bench
from sensor.laboratory.spiking import SpikeCounter, silicon_setting


@dataclass(frozen=True)
class Camera:
    """A camera of the catalogue.

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


def _adaptive(seed: int) -> Bench:
    return Bench(
        AdaptivePixels((32, 96)), 1e-10, 0.01, (0.01, 2, 4), rows=32, frames=6, stack=32,
        seed=seed, bias=None,
    )  # fmt: skip


def _emccd(seed: int) -> Bench:
    """Without multiplication; rows and columns of the image area."""
    pixels = EmccdPixels(gain=1.0, shape=(48, 88))
    return Bench(
        pixels, PITCH**2, 0.01, (0.01, 2, 4), rows=32, first=8, columns=(12, 64),
        levels=10, frames=6, stack=24, seed=seed, kept=frozenset(pixels.effects) - {"smear"},
    )  # fmt: skip


def _ebaps(seed: int) -> Bench:
    pixels = EbapsPixels(shape=(32, 96))
    rare = {"ion events", "direct light", "photocathode emission"}
    return Bench(
        pixels, pixels.silicon.area, 1e-3, (0.001, 0.1, 0.2), rows=32, levels=8, frames=8,
        stack=32, seed=seed, kept=frozenset(pixels.effects) - rare, linear=0.15,
    )  # fmt: skip


_COUNTS = (
    "the digital number is the number of spikes in an exposure of 50 ms; a spike is 1000 electrons",
    "imperfections of the preset silicon, assumed; defect pixels are left out",
    "dark current and DSNU are measured without the bias; the variance there is that of counting, "
    "so mu_I,var is no dark current",
    "the exposure begins at any instant between two spikes: of the dark noise, 1/6 DN^2 is the "
    "count's error at both ends of the exposure",
)
CAMERAS: Final = {
    camera.name: camera
    for camera in (
        Camera("spiketwo", "SpikeTwo (2021)", _spiking("spiketwo"), _COUNTS),
        Camera("spikeone", "SpikeOne (2017)", _spiking("spikeone"), _COUNTS),
        Camera("adaptive-exposure", "adaptive-exposure CMOS imager", _adaptive),
        Camera(
            "ebaps", "EBAPS at -1500 V", _ebaps,
            (
                "photons are counted at 555 nm; the sensitivity of the photocathode is that to a "
                "lamp with infrared light, so that the quantum efficiency may exceed 1",
                "the gain is measured with its excess noise factor F^2: K is K F^2, and the "
                "quantum efficiency is QE/F^2",
                "some ten photoelectrons fill the scale, so slopes are fitted up to 15 % of "
                "saturation; ion events, direct light and photocathode emission are left out",
            ),
        ),
        Camera(
            "emccd", "EMCCD, gain 1", _emccd,
            ("no multiplication and no smear: the parameters are those of the chip",),
        ),
    )
}  # fmt: skip
"""Cameras by name."""
