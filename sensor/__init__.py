"""Light to spikes: chips, the physics of the pixel, images from spike streams."""

from sensor.device.chips import CHIPS, Chip
from sensor.device.pattern import DevicePattern, dark_current
from sensor.latched.camera import SpikeCamera
from sensor.latched.effects import EFFECTS
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import make_pixels
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

__all__ = [
    "CHIPS",
    "EFFECTS",
    "METHODS",
    "CameraSetting",
    "Chip",
    "DevicePattern",
    "SpikeCamera",
    "dark_current",
    "interval_image",
    "interval_rate",
    "isi",
    "make_pixels",
    "tau_image",
    "tau_levels",
    "tfi",
    "tfp",
]
