"""Thresholds and initial charges as draws: one random word each, keyed by pixel, spike and seed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.pixel.fixed_point import Charge
from sensor.latched.pixel.interval import threshold

__all__ = ["first_thresholds", "initial_deficit", "thresholds"]


def thresholds(
    table: Charge,
    k: npt.NDArray[np.uint64],
    pixels: npt.NDArray[np.uint32],
    seed: int,
) -> Charge:
    """Threshold of spike k of each pixel, Q24.40.

    Word k mod 4 of counter (pixel, high and low word of k div 4, 0), key (seed, SHOT_NOISE).
    """
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, Stream.SHOT_NOISE))
    return threshold(table, np.choose((k & np.uint64(3)).astype(np.intp), words))


def first_thresholds(table: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Threshold of spike 0 of each pixel."""
    return thresholds(table, np.zeros(pixels.shape, np.uint64), pixels, seed)


def initial_deficit(first: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Deficit (threshold - charge - 1, Q24.40) of each pixel before its first cycle.

    first: thresholds of spike 0, (n,) int64. The charge is threshold x word / 2^32, rounded down,
    in integers: it is below the threshold, so the deficit is never negative.
    """
    word = philox4x32((pixels, 0, 0, 0), (seed, Stream.INITIAL_CHARGE))[0].astype(np.int64)
    high, low = first >> 32, first & 0xFFFFFFFF
    charge = high * word + ((low * word) >> 32)
    return first - charge - 1
