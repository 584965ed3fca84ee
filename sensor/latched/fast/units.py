"""Charge in 32 bits: thresholds and light in units of threshold / 2^bits; the interval's law.

Two forms. A group of pixels whose threshold is always the same (no noise, no dead time) holds its
charge as a phase of 2^32, whose carry is the spike. All others hold the deficit, threshold - charge
- 1, in units of which 2^bits are the nominal threshold: 28 bits, fewer where the law of the
interval has a tail that is long beside its mean (24 at one electron).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, floor, log2
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.pixel.interval import KNOTS
from sensor.latched.pixel.model import ExactModel
from sensor.latched.pixel.thresholds import thresholds

__all__ = [
    "BITS",
    "CAP",
    "DEAD_TIME",
    "DEEPEST",
    "EMPTY",
    "NOISE",
    "RESET",
    "Units",
    "drawn",
    "first_charge",
    "quantile",
    "running",
    "units_of",
]

Array = npt.NDArray[np.float64]

NOISE: Final = 1
"""Flag of a group: each spike draws its threshold."""
DEAD_TIME: Final = 2
"""Flag of a group: each spike costs light."""
RESET: Final = 4
"""Flag of every group under another reset rule than carrying the residual: its state is the
deficit."""

BITS: Final = 28
_PILED_BITS: Final = 24
"""The same under `subtract`, where charge beyond the threshold piles up."""
_LONGEST: Final = 29
"""Thresholds stay below 2^29 units, so that no sum of a few leaves 32 bits."""
CAP: Final = 1 << 30
"""Most light of a cycle, in units: two of the longest thresholds."""
DEEPEST: Final = -(1 << 30)
"""Least deficit under `subtract`: 64 thresholds beyond one, or 2^21 electrons as in the exact tier
where that is less."""
EMPTY: Final = -(1 << 30)
"""Stands for a threshold that has not been drawn: nothing added to it is positive."""

OCTAVES: Final = 32
"""Octaves of probability on each side of the median: one of y = 0, and those of 2^0 to 2^30."""
DEGREE: Final = 5
_KNOTS: Final = 128
"""Knots of the exact tier's table in an octave."""
_PIECE: Final = 16384
"""Pixels whose first charge is drawn at a time: so many that all that it takes stays in a cache."""


def _octave(exact: npt.NDArray[np.int64], octave: int) -> tuple[Array, Array]:
    """Places in an octave, -1/2 to 1/2, and the exact tier's quantiles there."""
    if octave == 0:
        return np.zeros(1), exact[:1].astype(np.float64)
    if octave <= 7:  # fewer whole words than knots; the last is the next octave's first
        y = np.arange(1 << (octave - 1), (1 << octave) + 1)
        return y / (1 << (octave - 1)) - 1.5, exact[y].astype(np.float64)
    begin = (octave - 7) * _KNOTS
    return (
        np.linspace(-0.5, 0.5, _KNOTS + 1),
        exact[begin : begin + _KNOTS + 1].astype(np.float64),
    )


def _fitted(knots: npt.NDArray[np.int64], scale: float) -> tuple[npt.NDArray[np.int32], float]:
    """Polynomials of every octave, in units, and their largest error there.

    (DEGREE + 1, 2, OCTAVES) int32: the constants as integers, the others as the bits of float32.
    """
    table = np.zeros((DEGREE + 1, 2, OCTAVES), np.float64)
    worst = 0.0
    for side, octave in np.ndindex(2, OCTAVES):
        s, value = _octave(knots.reshape(2, KNOTS)[side], octave)
        degree = min(DEGREE, s.size - 1)
        # Weighted like Chebyshev's points, so that the error is spread evenly.
        weight = np.maximum(1 - 4 * s * s, 1e-3) ** -0.25
        fit = chebyshev.chebfit(2 * s, value * scale, degree, w=weight)
        there = chebyshev.chebval(2 * s, fit)
        bow = np.abs(np.diff(there, 2)).max() if octave > 7 else 0.0
        # At the knots, and halfway between them, where the exact tier runs straight.
        worst = max(worst, float(np.abs(there - value * scale).max() + bow / 6))
        power = chebyshev.cheb2poly(fit) * 2.0 ** np.arange(fit.size)
        table[: power.size, side, octave] = power
    whole = np.rint(table[0]).astype(np.int32)
    return np.concatenate([whole[None], table[1:].astype(np.float32).view(np.int32)]), worst


@dataclass(frozen=True, eq=False)
class Units:
    """bits: 2^bits units are the nominal threshold. table: polynomials of the quantiles, (DEGREE +
    1, 2, OCTAVES) int32. top: the longest threshold, shortest: that can be drawn. error: largest
    difference from the exact tier's. All three in units."""

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
    return model.first_table() if model.random_start else model.table()


def units_of(model: ExactModel) -> Units:
    """Units and table for a model's thresholds."""
    most = _PILED_BITS if model.reset == "subtract" else BITS
    if not model.noisy:
        one = 1 << most
        return Units(most, np.zeros((DEGREE + 1, 2, OCTAVES), np.int32), one, one, 0.0)
    knots, first = model.table(), _first_table(model)
    longest = int(max(knots.max(), first.max()))
    bits = min(most, floor(_LONGEST - log2(longest / model.q)))
    scale = 2.0**bits / model.q
    table, error = _fitted(knots, scale)
    # Rounded thrice: the constant, the polynomial in float32, its integer.
    float_error = 8 * 2.0**-24 * float(np.abs(table[1:].view(np.float32)).max())
    error += 1.5 + float_error
    top = ceil(longest * scale + error) + 1
    shortest = max(floor(int(knots.min()) * scale - error), 1)
    return Units(bits, table, top, shortest, error)


def quantile(table: npt.NDArray[np.int32], word: npt.NDArray[np.uint32]) -> npt.NDArray[np.int32]:
    """Threshold in units for each random word: the plain form of the kernel's `quantile`.

    The distance y from the nearer end of (0, 1) as a float is an octave (its exponent) and a place
    in it (its mantissa), at which a polynomial is taken.
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


def drawn(
    units: Units, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32], seed: int
) -> npt.NDArray[np.int32]:
    """Threshold of spike k of each pixel: the word of the exact tier, looked up in units."""
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, Stream.SHOT_NOISE))
    return quantile(units.table, np.choose((k & np.uint64(3)).astype(np.intp), words))


def first_charge(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.int32]:
    """State before the first cycle: the exact tier's, rounded, for pixels with these flags."""
    charge = np.empty(pixels.shape, np.int32)
    for begin in range(0, pixels.size, _PIECE):
        part = slice(begin, begin + _PIECE)
        noisy = (flags[part] & NOISE) != 0
        if noisy.any():  # most planes have one kind of pixel alone
            charge[part][noisy] = _noisy(model, units, pixels[part][noisy])
        if not noisy.all():
            still = flags[part][~noisy]
            charge[part][~noisy] = _steady(model, units, pixels[part][~noisy], still)
    return charge


def _noisy(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32]
) -> npt.NDArray[np.int32]:
    deficit = model.initial(pixels).deficit * (2.0**units.bits / model.q)
    return np.rint(deficit).astype(np.int32)


def _steady(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.int32]:
    """Without noise; a phase where there are no flags at all."""
    effects = tuple(e for e in model.effects if e.stream is not Stream.SHOT_NOISE)
    deficit = replace(model, effects=effects, threshold_noise=0.0).initial(pixels).deficit + 1
    phase = np.floor((1 - deficit / model.q) * 2.0**32).astype(np.int64).astype(np.uint32)
    quiet = np.ceil(deficit * (2.0**units.bits / model.q)) - 1  # a tie fires
    return np.where(flags == 0, phase.view(np.int32), quiet.astype(np.int32))


def running(
    model: ExactModel, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32]
) -> npt.NDArray[np.float64]:
    """Threshold of the running interval k of each pixel, in nominal thresholds."""
    table: Any = model.table()
    later = thresholds(table, k, pixels, model.seed)
    first = thresholds(_first_table(model), k, pixels, model.seed)
    return np.where(k == 0, first, later) / model.q
