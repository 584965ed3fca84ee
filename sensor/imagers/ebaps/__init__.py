"""EBAPS: photocathode, electron bombardment and the silicon behind, from light to 16-bit numbers."""

from sensor.imagers.ebaps.pixels import BITS, COLUMNS, ROWS, EbapsPixels
from sensor.imagers.ebaps.silicon import Pattern, Silicon
from sensor.imagers.ebaps.tube import PAIR_ENERGY, Tube

__all__ = [
    "BITS",
    "COLUMNS",
    "PAIR_ENERGY",
    "ROWS",
    "EbapsPixels",
    "Pattern",
    "Silicon",
    "Tube",
]
