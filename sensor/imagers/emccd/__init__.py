"""Frame-transfer EMCCD of seed 003: multiplication register, gain, dark current, wells, pixels."""

from sensor.imagers.emccd import chip
from sensor.imagers.emccd.dark import DARK_AT_20C, DSNU_SHARE, dark_current
from sensor.imagers.emccd.gain import (
    GAIN_RANGE,
    GAIN_STEPS,
    SUMMARY_PEAK,
    TEXT_PEAK,
    HighVoltage,
    document_gain,
)
from sensor.imagers.emccd.laws import (
    LAWS,
    basden_law,
    exact_law,
    fast_law,
    law_distance,
    tubbs_law,
    yule_law,
)
from sensor.imagers.emccd.multiplication import (
    branch,
    excess_noise_squared,
    fast_shape,
    multiply,
    stage_probability,
)
from sensor.imagers.emccd.pixels import EmccdExposed, EmccdPixels
from sensor.imagers.emccd.smear import without_smear
from sensor.imagers.emccd.wells import (
    columns_filled,
    electrons_to_fill,
    spill_columns,
    spill_lines,
)

__all__ = [
    "DARK_AT_20C",
    "DSNU_SHARE",
    "GAIN_RANGE",
    "GAIN_STEPS",
    "LAWS",
    "SUMMARY_PEAK",
    "TEXT_PEAK",
    "EmccdExposed",
    "EmccdPixels",
    "HighVoltage",
    "basden_law",
    "branch",
    "chip",
    "columns_filled",
    "dark_current",
    "document_gain",
    "electrons_to_fill",
    "exact_law",
    "excess_noise_squared",
    "fast_law",
    "fast_shape",
    "law_distance",
    "multiply",
    "spill_columns",
    "spill_lines",
    "stage_probability",
    "tubbs_law",
    "without_smear",
    "yule_law",
]
