"""Closed forms of a link: error rates, fading, air, codewords, capacity; and their Monte Carlo."""

from link.theory.capacity import (
    binary_capacity,
    count_capacity,
    entropy,
    one_bit_capacity,
    poisson_best_duty,
    poisson_capacity,
)
from link.theory.charge import (
    Reset,
    charge_errors,
    charge_kernels,
    longest_off_run,
    poisson_threshold,
    residual_errors,
)
from link.theory.estimate import count_laws, pixel_errors
from link.theory.extinction import (
    Particles,
    extinction_db_per_km,
    size_exponent,
    transmittance,
)
from link.theory.fading import (
    Convention,
    amplitude_of,
    awgn_ook,
    gamma_gamma_ook,
    log_normal_ook,
    log_normal_sigma,
)
from link.theory.intervals import JUDGED, clopper_pearson, pointwise_level
from link.theory.patterns import hard_patterns, survival
from link.theory.pointing import Pointing
from link.theory.scintillation import (
    correlation_time,
    fried,
    gamma_gamma,
    greenwood,
    p1814_scintillation_db,
    rytov,
    scintillation_index,
)
from link.theory.words import burst_byte_error, burst_word_error, byte_error, rs_word_error

__all__ = [
    "JUDGED",
    "Convention",
    "Particles",
    "Pointing",
    "Reset",
    "amplitude_of",
    "awgn_ook",
    "binary_capacity",
    "burst_byte_error",
    "burst_word_error",
    "byte_error",
    "charge_errors",
    "charge_kernels",
    "clopper_pearson",
    "correlation_time",
    "count_capacity",
    "count_laws",
    "entropy",
    "extinction_db_per_km",
    "fried",
    "gamma_gamma",
    "gamma_gamma_ook",
    "greenwood",
    "hard_patterns",
    "log_normal_ook",
    "log_normal_sigma",
    "longest_off_run",
    "one_bit_capacity",
    "p1814_scintillation_db",
    "pixel_errors",
    "pointwise_level",
    "poisson_best_duty",
    "poisson_capacity",
    "poisson_threshold",
    "residual_errors",
    "rs_word_error",
    "rytov",
    "scintillation_index",
    "size_exponent",
    "survival",
    "transmittance",
]
