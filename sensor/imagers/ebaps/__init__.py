"""EBAPS: photocathode, electron bombardment and the silicon behind it, from light to numbers."""

from sensor.imagers.ebaps.brightness import wanted_exposure
from sensor.imagers.ebaps.contrast import Chart, contrast_to_noise, recognisable, smallest_bar
from sensor.imagers.ebaps.pixels import COLUMNS, ROWS, EbapsPixels
from sensor.imagers.ebaps.spectral import PHOTOCATHODES, spectral_ratios
from sensor.imagers.ebaps.tube import Tube

__all__ = [
    "COLUMNS",
    "PHOTOCATHODES",
    "ROWS",
    "Chart",
    "EbapsPixels",
    "Tube",
    "contrast_to_noise",
    "recognisable",
    "smallest_bar",
    "spectral_ratios",
    "wanted_exposure",
]
