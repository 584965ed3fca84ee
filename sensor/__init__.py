"""Light to spikes: chips, the physics of the pixel, images from spike streams."""

from sensor.device.chips import CHIPS
from sensor.latched.camera import SpikeCamera
from sensor.latched.effects import EFFECTS
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import make_pixels
from sensor.reconstruct import (
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
    "CameraSetting",
    "SpikeCamera",
    "interval_rate",
    "isi",
    "make_pixels",
    "tau_image",
    "tau_levels",
    "tfi",
    "tfp",
]
