"""Light to spikes: chips, the physics of the pixel, images from spike streams."""

from sensor.camera import CameraSetting, SpikeCamera, make_pixels
from sensor.chips import CHIPS, Chip
from sensor.effects import EFFECTS
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
