"""The EBAPS imaging circuit: timing, exposure loop, dark subtraction, registers, whole imager."""

from rtl_model.imagers.ebaps.darks import (
    DARKS,
    TRUNCATION,
    TRUNCATION_VARIANCE,
    clipped_mean,
    mean_of_four,
    residual_variance,
    stale_variance,
    subtract,
)
from rtl_model.imagers.ebaps.exposure import (
    ACCUMULATOR_BITS,
    DEFAULT_EXPOSURE,
    LATENCY,
    SHORTEST_EXPOSURE,
    STEP,
    WINDOW,
    ExposureRule,
    Linear,
    follow,
)
from rtl_model.imagers.ebaps.extremes import (
    accumulated,
    dark_then_light,
    light_steps,
    shipped_loop,
    swinging,
)
from rtl_model.imagers.ebaps.imager import Ebaps
from rtl_model.imagers.ebaps.machine import machine
from rtl_model.imagers.ebaps.regions import LIVE, REGIONS, FrameMemory, PlainMemory, region_bytes
from rtl_model.imagers.ebaps.registers import DESIGN, HIGH_VOLTAGE
from rtl_model.imagers.ebaps.sequencer import Read, Sequencer, Shot
from rtl_model.imagers.ebaps.settling import (
    Rest,
    last_hunting,
    resting,
    settle,
    settling_exposure,
    settling_share,
    spans,
)
from rtl_model.imagers.ebaps.timing import CLOCK_HZ, FRAME_RATE, Timing

__all__ = [
    "ACCUMULATOR_BITS",
    "CLOCK_HZ",
    "DARKS",
    "DEFAULT_EXPOSURE",
    "DESIGN",
    "FRAME_RATE",
    "HIGH_VOLTAGE",
    "LATENCY",
    "LIVE",
    "REGIONS",
    "SHORTEST_EXPOSURE",
    "STEP",
    "TRUNCATION",
    "TRUNCATION_VARIANCE",
    "WINDOW",
    "Ebaps",
    "ExposureRule",
    "FrameMemory",
    "Linear",
    "PlainMemory",
    "Read",
    "Rest",
    "Sequencer",
    "Shot",
    "Timing",
    "accumulated",
    "clipped_mean",
    "dark_then_light",
    "follow",
    "last_hunting",
    "light_steps",
    "machine",
    "mean_of_four",
    "region_bytes",
    "residual_variance",
    "resting",
    "settle",
    "settling_exposure",
    "settling_share",
    "shipped_loop",
    "spans",
    "stale_variance",
    "subtract",
    "swinging",
]
