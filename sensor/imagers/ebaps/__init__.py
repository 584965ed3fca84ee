"""EBAPS: photocathode, electron bombardment and the silicon behind it, from light to numbers."""

from sensor.imagers.ebaps.brightness import brightness, brightness_constant, wanted_exposure
from sensor.imagers.ebaps.contrast import (
    ASPECT,
    ROSE,
    Chart,
    contrast_to_noise,
    recognisable,
    smallest_bar,
)
from sensor.imagers.ebaps.pixels import BITS, COLUMNS, ROWS, EbapsPixels
from sensor.imagers.ebaps.silicon import Pattern, Silicon
from sensor.imagers.ebaps.tube import PAIR_ENERGY, Tube

__all__ = [
    "ASPECT",
    "BITS",
    "COLUMNS",
    "PAIR_ENERGY",
    "ROSE",
    "ROWS",
    "Chart",
    "EbapsPixels",
    "Pattern",
    "Silicon",
    "Tube",
    "brightness",
    "brightness_constant",
    "contrast_to_noise",
    "recognisable",
    "smallest_bar",
    "wanted_exposure",
]
