"""Light to spikes: chips, the physics of the pixel, images from spike streams."""

from sensor.camera import SpikeCamera
from sensor.chips import CHIPS, Chip
from sensor.effects import EFFECTS, ktc_electrons
from sensor.pattern import DevicePattern, dark_current
from sensor.reconstruct import (
    METHODS,
    interval_image,
    interval_rate,
    isi,
    tau_image,
    tau_levels,
    tfi,
    tfp,
)
from sensor.setting import CameraSetting
from sensor.silicon import SILICON, Silicon, Sized
from sensor.tiers import make_pixels

__all__ = [
    "CHIPS",
    "EFFECTS",
    "METHODS",
    "SILICON",
    "CameraSetting",
    "Chip",
    "DevicePattern",
    "Silicon",
    "Sized",
    "SpikeCamera",
    "dark_current",
    "interval_image",
    "interval_rate",
    "isi",
    "ktc_electrons",
    "make_pixels",
    "tau_image",
    "tau_levels",
    "tfi",
    "tfp",
]
