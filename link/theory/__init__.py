"""Closed forms of a link: error rates, fading, codewords, capacity; and their Monte Carlo
trials."""

from link.theory.air import (
    Convention,
    amplitude_of,
    awgn_ook,
    gamma_gamma,
    gamma_gamma_ook,
    log_normal_ook,
    log_normal_sigma,
    scintillation_index,
)
from link.theory.capacity import count_capacity, one_bit_capacity, poisson_capacity
from link.theory.charge import (
    PixelChannel,
    Reset,
    charge_errors,
    hard_patterns,
    longest_off_run,
    poisson_threshold,
)
from link.theory.estimate import count_laws, pixel_errors
from link.theory.intervals import JUDGED, clopper_pearson, pointwise_level
from link.theory.words import (
    burst_byte_error,
    burst_word_error,
    ldpc_word_error,
    rs_word_error,
    word_loss,
)

__all__ = [
    "JUDGED",
    "Convention",
    "PixelChannel",
    "Reset",
    "amplitude_of",
    "awgn_ook",
    "burst_byte_error",
    "burst_word_error",
    "charge_errors",
    "clopper_pearson",
    "count_capacity",
    "count_laws",
    "gamma_gamma",
    "gamma_gamma_ook",
    "hard_patterns",
    "ldpc_word_error",
    "log_normal_ook",
    "log_normal_sigma",
    "longest_off_run",
    "one_bit_capacity",
    "pixel_errors",
    "pointwise_level",
    "poisson_capacity",
    "poisson_threshold",
    "rs_word_error",
    "scintillation_index",
    "word_loss",
]
