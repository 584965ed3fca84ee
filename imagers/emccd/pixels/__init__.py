"""Frame-transfer EMCCD of seed 003: multiplication register, gain, dark current, wells, pixels."""

from imagers.emccd.pixels.array import EmccdExposed, EmccdPixels
from imagers.emccd.pixels.gain import GAIN_RANGE, SUMMARY_PEAK, TEXT_PEAK, HighVoltage
from imagers.emccd.pixels.multiplication import excess_noise_squared
from imagers.emccd.pixels.smear import without_smear
from imagers.emccd.pixels.wells import columns_filled, electrons_to_fill, spill_lines

__all__ = [
    "GAIN_RANGE",
    "SUMMARY_PEAK",
    "TEXT_PEAK",
    "EmccdExposed",
    "EmccdPixels",
    "HighVoltage",
    "columns_filled",
    "electrons_to_fill",
    "excess_noise_squared",
    "spill_lines",
    "without_smear",
]
