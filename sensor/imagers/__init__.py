"""Pixels of conventional imagers: from light to digital numbers, row by row."""

from sensor.imagers.draws import binomial, gamma, negative_binomial, normal, poisson
from sensor.imagers.pixel import Exposed, ImagerSummary, PixelModel, Values
from sensor.imagers.scenery import Course, LightScenery, Scenery, Still

__all__ = [
    "Course",
    "Exposed",
    "ImagerSummary",
    "LightScenery",
    "PixelModel",
    "Scenery",
    "Still",
    "Values",
    "binomial",
    "gamma",
    "negative_binomial",
    "normal",
    "poisson",
]
