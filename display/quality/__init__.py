"""How good a display is: pure functions of light waveforms and edge profiles."""

from display.quality.blur import (
    STEP_SHARE,
    bet,
    blur_edge_width,
    cmr_like,
    ebet,
    mprt,
    mprt_full_width,
)
from display.quality.figures import FlickerFigures, flicker_figures
from display.quality.flicker import (
    LIMITS,
    Ieee1789,
    flicker_index,
    ieee_1789,
    percent_flicker,
    risk_of,
)
from display.quality.latency import fallen, half_way, relaxed, risen
from display.quality.pstlm import LEAST_SECONDS, pst_lm
from display.quality.spectrum import Spectrum, spectrum
from display.quality.svm import LEAST_RATE, svm, svm_threshold
from display.quality.tcsf import critical_frequency, sensitivity, tcsf, tcsf_visibility

__all__ = [
    "LEAST_RATE", "LEAST_SECONDS", "LIMITS", "STEP_SHARE", "FlickerFigures", "Ieee1789",
    "Spectrum", "bet", "blur_edge_width", "cmr_like", "critical_frequency", "ebet", "fallen",
    "flicker_figures", "flicker_index", "half_way", "ieee_1789", "mprt", "mprt_full_width",
    "percent_flicker", "pst_lm", "relaxed", "risen", "risk_of", "sensitivity", "spectrum", "svm",
    "svm_threshold", "tcsf", "tcsf_visibility",
]  # fmt: skip
