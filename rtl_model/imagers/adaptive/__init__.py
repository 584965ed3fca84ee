"""The adaptive-exposure CMOS sensor: statistics, decision, double reset counters, registers."""

from rtl_model.imagers.adaptive.decision import (
    HALF_SCALE,
    LONGEST,
    MULTIPLIER_BITS,
    PRINTED_MULTIPLIER_BITS,
    Decision,
    Search,
    decide,
    lengthening,
    shortened,
)
from rtl_model.imagers.adaptive.imager import AdaptiveExposure
from rtl_model.imagers.adaptive.registers import REGISTERS, parameters
from rtl_model.imagers.adaptive.sequencer import (
    Sequencer,
    actual_exposures,
    disturbed,
    frames_of,
)
from rtl_model.imagers.adaptive.statistics import Statistics, Window, gather
from rtl_model.imagers.adaptive.timing import (
    CLOCK_HZ,
    FRAME_RATE,
    MINIMUM_CLOCKS,
    FrameTiming,
    Timing,
)

__all__ = [
    "CLOCK_HZ",
    "FRAME_RATE",
    "HALF_SCALE",
    "LONGEST",
    "MINIMUM_CLOCKS",
    "MULTIPLIER_BITS",
    "PRINTED_MULTIPLIER_BITS",
    "REGISTERS",
    "AdaptiveExposure",
    "Decision",
    "FrameTiming",
    "Search",
    "Sequencer",
    "Statistics",
    "Timing",
    "Window",
    "actual_exposures",
    "decide",
    "disturbed",
    "frames_of",
    "gather",
    "lengthening",
    "parameters",
    "shortened",
]
