"""Draws of thresholds and initial charges within compiled loops, for numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from cosim.compute.philox_compiled import ten_rounds
from cosim.compute.streams import Stream
from sensor.latched.pixel.interval import KNOTS, MANTISSA_BITS

_SHOT, _INITIAL = np.uint64(Stream.SHOT_NOISE), np.uint64(Stream.INITIAL_CHARGE)
_TOGETHER = 1024
"""Pixels whose words are drawn at once."""


@njit(cache=True, nogil=True)
def look_up(table, word):  # type: ignore[no-untyped-def]
    """Threshold in Q24.40 of a random word below 2^32: `interval.threshold` for one word. Without
    branches, so that loops over it are vectorised."""
    word = np.int64(word)
    upper = word >> 31
    y = word ^ (upper * np.int64(0xFFFFFFFF))
    exponent, rest = np.int64(0), y >> MANTISSA_BITS  # the exponent: bits of `rest`, less one
    for bits in (16, 8, 4, 2, 1):
        part = np.int64(rest >= 1 << bits) * bits
        rest >>= part
        exponent += part
    mantissa = y >> exponent
    index = upper * KNOTS + (exponent << MANTISSA_BITS) + mantissa
    fraction = ((y - (mantissa << exponent)) << 16) >> exponent
    low = table[index]
    step = table[min(index + 1, table.size - 1)] - low  # see `interval.threshold`
    return low + (step >> 16) * fraction + (((step & 0xFFFF) * fraction) >> 16)


@njit(cache=True, nogil=True)
def first_deficits(pixels, seed, table, noisy, q, random, beyond, out):  # type: ignore[no-untyped-def]
    """Fills `out`, (n,) int64 Q24.40, with the deficits before the first cycle of the pixels with
    these numbers: `ExactModel.initial` for one after another.

    Args:
        pixels: (n,) uint32.
        seed: seed of the run, uint64.
        table: quantiles of the first threshold, used only if `noisy`; else it is `q`.
        noisy: whether thresholds are drawn.
        q: mean threshold, Q24.40.
        random: whether the initial charge is random.
        beyond: part of the threshold that is no share of the charge, Q24.40.
        out: an output.
    """
    zero, low_bits = np.uint64(0), np.uint64(0xFFFFFFFF)
    shot, charge = np.empty(_TOGETHER, np.uint64), np.empty(_TOGETHER, np.uint64)
    for begin in range(0, pixels.size, _TOGETHER):
        some = pixels[begin : begin + _TOGETHER]
        for n in range(some.size):
            pixel = np.uint64(some[n])
            shot[n] = ten_rounds(pixel, zero, zero, zero, seed, _SHOT)[0]
            charge[n] = ten_rounds(pixel, zero, zero, zero, seed, _INITIAL)[0]
        for n in range(some.size):
            first = look_up(table, shot[n]) if noisy else np.int64(q)
            if random:
                first = max(first - beyond, 1)
                rest = ((np.uint64(first) & low_bits) * charge[n]) >> np.uint64(32)
                first += beyond - (first >> 32) * np.int64(charge[n]) - np.int64(rest)
            out[begin + n] = first - 1
