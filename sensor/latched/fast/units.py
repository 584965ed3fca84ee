"""Charge in 32 bits, and the distribution of thresholds in these units.

There are two forms. A group of pixels with constant threshold and no dead time stores its charge as
a phase in 2^-32 of a threshold, whose carry is the spike. All other groups store the deficit,
threshold - charge - 1, in units of 2^-bits of the nominal threshold. There are 28 bits, and fewer
if the distribution of intervals has a long tail (24 at one electron).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from math import ceil, floor, log2
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from cosim.compute.cores import by_rows
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.pixel.interval import KNOTS
from sensor.latched.pixel.model import ExactModel
from sensor.latched.pixel.thresholds import thresholds

Array = npt.NDArray[np.float64]

NOISE: Final = 1
"""Flag of a group: the threshold of each spike is drawn."""
DEAD_TIME: Final = 2
"""Flag of a group: light is lost at each spike."""
RESET: Final = 4
"""Flag of every group under a reset rule other than `residual`: its state is the deficit."""
TIMING: Final = 8
"""Flag of the groups of rows whose sampling instants a steered clock moves."""
BANK: Final = 16
"""Flag of a group with NOISE: thresholds come from the bank (sensor/latched/pixel/bank.py), one for
each group and cycle, and not from the random word of each spike."""
JITTER: Final = 32
"""Flag of the groups of rows whose pixels have timing noise."""

BITS: Final = 28
"""Most bits of the nominal threshold."""
_PILED_BITS: Final = 24
"""The same under `subtract`, where charge accumulates beyond the threshold."""
_LONGEST: Final = 29
"""Thresholds stay below 2^29 units, so that sums of a few fit in 32 bits."""
CAP: Final = 1 << 30
"""Upper limit of the light of a cycle, in units: two of the longest thresholds."""
DEEPEST: Final = -(1 << 30)
"""Lowest deficit under `subtract`: 64 thresholds, or 2^21 electrons as in the exact tier if that is
less."""
EMPTY: Final = -(1 << 30)
"""Value that stands for a threshold that is not drawn yet: sums with it are negative."""
NOTHING: Final = -1e30
"""Light of a pixel that gathers nothing, not even dark current: below 0 it is cut off."""

OCTAVES: Final = 32
"""Octaves of probability on each side of the median: one for y = 0, and those of 2^0 to 2^30."""
DEGREE: Final = 5
"""Degree of the polynomial of each octave."""
_KNOTS: Final = 128
"""Knots an octave in the table of the exact tier."""
_PIECE: Final = 1 << 15
"""Pixels whose initial charge is computed at a time, so that temporary arrays fit in the cache."""


def _octave(exact: npt.NDArray[np.int64], octave: int) -> tuple[Array, Array]:
    """Positions in an octave, -1/2 to 1/2, and the exact tier's quantiles there."""
    if octave == 0:
        return np.zeros(1), exact[:1].astype(np.float64)
    if octave <= 7:  # fewer integers than knots; the last is the first of the next octave
        y = np.arange(1 << (octave - 1), (1 << octave) + 1)
        return y / (1 << (octave - 1)) - 1.5, exact[y].astype(np.float64)
    begin = (octave - 7) * _KNOTS
    return (
        np.linspace(-0.5, 0.5, _KNOTS + 1),
        exact[begin : begin + _KNOTS + 1].astype(np.float64),
    )


def _fitted(knots: npt.NDArray[np.int64], scale: float) -> tuple[npt.NDArray[np.int32], float]:
    """Polynomials of all octaves, and their largest error, both in units.

    The table is (DEGREE + 1, 2, OCTAVES) int32: constants as integers, other coefficients as the
    bits of float32.
    """
    table = np.zeros((DEGREE + 1, 2, OCTAVES), np.float64)
    worst = 0.0
    for side, octave in np.ndindex(2, OCTAVES):
        s, value = _octave(knots.reshape(2, KNOTS)[side], octave)
        degree = min(DEGREE, s.size - 1)
        # Weights of Chebyshev points, which spread the error evenly.
        weight = np.maximum(1 - 4 * s * s, 1e-3) ** -0.25
        fit = chebyshev.chebfit(2 * s, value * scale, degree, w=weight)
        there = chebyshev.chebval(2 * s, fit)
        bow = np.abs(np.diff(there, 2)).max() if octave > 7 else 0.0
        # Error at the knots, and between them, where the exact tier interpolates linearly.
        worst = max(worst, float(np.abs(there - value * scale).max() + bow / 6))
        power = chebyshev.cheb2poly(fit) * 2.0 ** np.arange(fit.size)
        table[: power.size, side, octave] = power
    whole = np.rint(table[0]).astype(np.int32)
    fitted = np.concatenate([whole[None], table[1:].astype(np.float32).view(np.int32)])
    fitted.setflags(write=False)
    return fitted, worst


@dataclass(frozen=True, eq=False)
class Units:
    """Units of charge, and the distribution of thresholds in them.

    Attributes:
        bits: 2^bits units are the nominal threshold.
        table: (DEGREE + 1, 2, OCTAVES) int32, polynomials of the quantiles.
        top, shortest: longest and shortest threshold that can be drawn, in units.
        error: largest difference of a threshold from the exact tier's, in units.
    """

    bits: int
    table: npt.NDArray[np.int32]
    top: int
    shortest: int
    error: float

    @property
    def one(self) -> int:
        """The nominal threshold."""
        return 1 << self.bits


def _first_table(model: ExactModel) -> npt.NDArray[np.int64]:
    """Quantiles of the first threshold of a run, as in `ExactModel.first_thresholds`."""
    return model.first_table() if model.random_start else model.table()


def units_of(model: ExactModel) -> Units:
    """Units and table for the thresholds of a model, which do not depend on its seed."""
    return _units_of(replace(model, seed=0))


@lru_cache(maxsize=8)
def _units_of(model: ExactModel) -> Units:
    most = _PILED_BITS if model.reset == "subtract" else BITS
    if not model.noisy:
        one = 1 << most
        return Units(most, np.zeros((DEGREE + 1, 2, OCTAVES), np.int32), one, one, 0.0)
    knots, first = model.table(), _first_table(model)
    longest = int(max(knots.max(), first.max()))
    bits = min(most, floor(_LONGEST - log2(longest / model.q)))
    scale = 2.0**bits / model.q
    table, error = _fitted(knots, scale)
    # Three roundings: the constant, the polynomial in float32, and its integer.
    float_error = 8 * 2.0**-24 * float(np.abs(table[1:].view(np.float32)).max())
    error += 1.5 + float_error
    top = ceil(longest * scale + error) + 1
    shortest = max(floor(int(knots.min()) * scale - error), 1)
    return Units(bits, table, top, shortest, error)


def quantile(table: npt.NDArray[np.int32], word: npt.NDArray[np.uint32]) -> npt.NDArray[np.int32]:
    """Threshold in units of each random word, (n,) int32: the numpy form of the kernel's
    `quantile`.

    The distance y from the nearer end of (0, 1) is converted to float32. Its exponent selects the
    polynomial of an octave, and its mantissa is the argument.
    """
    word = np.asarray(word, np.uint32)
    upper = (word >> np.uint32(31)).astype(np.intp)
    y = np.where(upper == 1, ~word, word).astype(np.float32)
    bits = np.clip(y, np.float32(0.5), np.float32(2**31 - 128)).view(np.uint32)
    octave = (bits >> np.uint32(23)).astype(np.intp) - 126
    mantissa = (bits & np.uint32(0x7FFFFF)) | np.uint32(0x3F800000)
    s = mantissa.view(np.float32) - np.float32(1.5)
    terms = table.view(np.float32)[:, upper, octave]
    r = terms[DEGREE]
    for term in terms[DEGREE - 1 : 0 : -1]:
        r = r * s + term
    threshold = table[0, upper, octave] + (r * s).astype(np.int32)
    return np.maximum(threshold, 1)


def draw_thresholds(
    units: Units, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32], seed: int
) -> npt.NDArray[np.int32]:
    """Threshold of spike k of each pixel in units, (n,), from the random word of the exact tier."""
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, Stream.SHOT_NOISE))
    return quantile(units.table, np.choose((k & np.uint64(3)).astype(np.intp), words))


def first_charge(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.int32]:
    """State before the first cycle, (n,): the exact tier's, rounded. flags: (n,) of each pixel."""
    charge = np.empty(pixels.shape, np.int32)
    by_rows(partial(_first, model, units), pixels.size, pixels, flags, charge)
    return charge


def _first(
    model: ExactModel, units: Units, first: int, stop: int, pixels: npt.NDArray[np.uint32],
    flags: npt.NDArray[np.uint8], charge: npt.NDArray[np.int32],
) -> None:  # fmt: skip
    """`first_charge` of the pixels from `first` to `stop`."""
    for begin in range(first, stop, _PIECE):
        part = slice(begin, min(begin + _PIECE, stop))
        noisy = (flags[part] & NOISE) != 0
        if noisy.all():  # in most planes all pixels have the same flags
            charge[part] = _noisy(model, units, pixels[part])
            continue
        if noisy.any():
            charge[part][noisy] = _noisy(model, units, pixels[part][noisy])
        still = flags[part][~noisy]
        charge[part][~noisy] = _steady(model, units, pixels[part][~noisy], still)


def _noisy(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32]
) -> npt.NDArray[np.int32]:
    """Initial deficit of pixels with noise, in units."""
    deficit = model.initial(pixels).deficit * (2.0**units.bits / model.q)
    return np.rint(deficit).astype(np.int32)


def _steady(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.int32]:
    """Initial state of pixels without noise: the phase for flags 0, else the deficit."""
    effects = tuple(e for e in model.effects if e.stream is not Stream.SHOT_NOISE)
    deficit = replace(model, effects=effects, threshold_noise=0.0).initial(pixels).deficit + 1
    phase = np.floor((1 - deficit / model.q) * 2.0**32).astype(np.int64).astype(np.uint32)
    quiet = np.ceil(deficit * (2.0**units.bits / model.q)) - 1  # a tie fires
    return np.where(flags == 0, phase.view(np.int32), quiet.astype(np.int32))


def current_thresholds(
    model: ExactModel, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32]
) -> npt.NDArray[np.float64]:
    """Threshold of the current interval k of each pixel, (n,), in nominal thresholds."""
    table: Any = model.table()
    later = thresholds(table, k, pixels, model.seed)
    first = thresholds(_first_table(model), k, pixels, model.seed)
    return np.where(k == 0, first, later) / model.q
