"""Frame-transfer EMCCD of seed 003: multiplication register, gain, dark current, wells, pixels."""

from sensor.imagers.emccd.gain import GAIN_RANGE, SUMMARY_PEAK, TEXT_PEAK, HighVoltage
from sensor.imagers.emccd.multiplication import excess_noise_squared
from sensor.imagers.emccd.pixels import EmccdExposed, EmccdPixels
from sensor.imagers.emccd.smear import without_smear
from sensor.imagers.emccd.wells import columns_filled, electrons_to_fill, spill_lines

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
