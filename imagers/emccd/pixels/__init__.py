"""Frame-transfer EMCCD of document 003: multiplication, gain, dark current, wells, pixels."""

from imagers.emccd.pixels.array import EmccdExposed, EmccdPixels
from imagers.emccd.pixels.multiplication import (
    GAIN_RANGE,
    SUMMARY_PEAK,
    TEXT_PEAK,
    HighVoltage,
    excess_noise_squared,
)
from imagers.emccd.pixels.wells import columns_filled, electrons_to_fill, spill_lines, without_smear

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
