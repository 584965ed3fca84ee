"""EBAPS: photocathode, electron bombardment and the silicon behind it, from light to numbers."""

from imagers.ebaps.pixels.array import COLUMNS, ROWS, EbapsPixels
from imagers.ebaps.pixels.contrast import (
    Chart,
    contrast_to_noise,
    recognisable,
    smallest_bar,
    wanted_exposure,
)
from imagers.ebaps.pixels.tube import PHOTOCATHODES, Tube, spectral_ratios

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
