"""EBAPS: photocathode, electron bombardment and the silicon behind it, from light to numbers."""

from sensor.imagers.ebaps.brightness import wanted_exposure
from sensor.imagers.ebaps.contrast import Chart, contrast_to_noise, recognisable, smallest_bar
from sensor.imagers.ebaps.pixels import COLUMNS, ROWS, EbapsPixels

__all__ = [
    "COLUMNS",
    "ROWS",
    "Chart",
    "EbapsPixels",
    "contrast_to_noise",
    "recognisable",
    "smallest_bar",
    "wanted_exposure",
]
