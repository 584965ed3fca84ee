"""What lies between panel and camera: geometry, lens, air, stray light."""

from link.air.air import Air, lens_psf
from link.air.emission import Source
from link.air.geometry import image_of
from link.air.names import NAMES
from link.air.radiometry import Levels, background_lux, f_number_for, levels, on_lux
from link.air.setting import Aim, AirSetting, Optics

__all__ = [
    "NAMES",
    "Aim",
    "Air",
    "AirSetting",
    "Levels",
    "Optics",
    "Source",
    "background_lux",
    "f_number_for",
    "image_of",
    "lens_psf",
    "levels",
    "on_lux",
]
