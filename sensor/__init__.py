"""Light to spikes: chips, the physics of the pixel, images from spike streams."""

from sensor.camera import CameraSetting, SpikeCamera, make_pixels
from sensor.chips import CHIPS, Chip
from sensor.effects import EFFECTS
from sensor.reconstruct import METHODS, interval_image, interval_rate, isi, tau_image, tfi, tfp

__all__ = [
    "CHIPS",
    "EFFECTS",
    "METHODS",
    "CameraSetting",
    "Chip",
    "SpikeCamera",
    "interval_image",
    "interval_rate",
    "isi",
    "make_pixels",
    "tau_image",
    "tfi",
    "tfp",
]
