"""Pixels of conventional imagers: from light to digital numbers, row by row."""

from sensor.imagers.draws import normal
from sensor.imagers.pixel import Exposed, ImagerSummary, PixelModel
from sensor.imagers.scenery import Course, LightScenery, Scenery, Still

__all__ = [
    "Course",
    "Exposed",
    "ImagerSummary",
    "LightScenery",
    "PixelModel",
    "Scenery",
    "Still",
    "normal",
]
