"""Draws of thresholds and initial charges: one random word each, keyed by pixel, spike and seed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.pixel.charge import Charge
from sensor.latched.pixel.interval import threshold


def spike_words(
    k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32], seed: int
) -> npt.NDArray[np.uint32]:
    """Random word of spike k of each pixel, (n,) uint32: word k mod 4 of counter (pixel, high and
    low word of k div 4, 0), with key (seed, SHOT_NOISE)."""
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, Stream.SHOT_NOISE))
    return np.asarray(np.choose((k & np.uint64(3)).astype(np.intp), words), np.uint32)


def thresholds(
    table: Charge,
    k: npt.NDArray[np.uint64],
    pixels: npt.NDArray[np.uint32],
    seed: int,
) -> Charge:
    """Threshold of spike k of each pixel, (n,) Q24.40: the quantile of its random word.

    Args:
        table: quantiles, see `interval_table`.
        k: (n,) index of the spike.
        pixels: (n,) numbers of the pixels.
        seed: seed of the run.
    """
    return threshold(table, spike_words(k, pixels, seed))


def first_thresholds(table: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Threshold of spike 0 of each pixel, (n,) Q24.40."""
    return thresholds(table, np.zeros(pixels.shape, np.uint64), pixels, seed)


def initial_deficit(first: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Deficit (threshold - charge - 1, Q24.40) of each pixel before its first cycle, (n,).

    The charge is threshold x word / 2^32, rounded down in integers. It is below the threshold, so
    the deficit is never negative.

    Args:
        first: (n,) int64, thresholds of spike 0.
        pixels: (n,) numbers of the pixels.
        seed: seed of the run.
    """
    word = philox4x32((pixels, 0, 0, 0), (seed, Stream.INITIAL_CHARGE))[0].astype(np.int64)
    high, low = first >> 32, (first & 0xFFFFFFFF).astype(np.uint64)
    rest = (low * word.astype(np.uint64)) >> np.uint64(32)  # the product may exceed int64
    return np.asarray(first - high * word - rest.astype(np.int64) - 1)
