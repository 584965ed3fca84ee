"""The optical path from panel to camera: geometry, lens, atmosphere, stray light."""

from link.air.air import Air, lens_psf
from link.air.effects import Change, air_effects
from link.air.emission import Source
from link.air.geometry import image_of
from link.air.radiometry import f_number_for, levels
from link.air.setting import Aim, AirSetting, Optics, Scene
from link.air.summary import LinkSummary, ber, ber_units, link_summary

__all__ = [
    "Aim",
    "Air",
    "AirSetting",
    "Change",
    "LinkSummary",
    "Optics",
    "Scene",
    "Source",
    "air_effects",
    "ber",
    "ber_units",
    "f_number_for",
    "image_of",
    "lens_psf",
    "levels",
    "link_summary",
]
