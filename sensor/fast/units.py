"""Charge in 32 bits: thresholds and light in units of threshold / 2^bits, and their table.

Two forms. A group of pixels whose threshold is always the same (no noise, no dead time) holds its
charge as a phase of 2^32, whose carry is the spike. All others hold the deficit, threshold - charge
- 1, in units of which 2^bits are the nominal threshold: 28 bits, fewer where the law of the
interval has a tail that is long beside its mean (24 at one electron).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import floor, log2
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.philox import philox4x32
from sensor.effects import INITIAL_CHARGE, SHOT_NOISE
from sensor.pixel.interval import KNOTS
from sensor.pixel.model import ExactModel

__all__ = [
    "BITS",
    "CAP",
    "DEAD_TIME",
    "EMPTY",
    "NOISE",
    "SIDE",
    "SMALLEST",
    "Units",
    "quantile",
    "units_of",
]

NOISE: Final = 1
"""Flag of a group: each spike draws its threshold."""
DEAD_TIME: Final = 2
"""Flag of a group: each spike costs light."""

BITS: Final = 28
_LONGEST: Final = 29
"""Thresholds stay below 2^29 units, so that no sum of a few leaves 32 bits."""
CAP: Final = 1 << 30
"""Most light of a cycle, in units: two of the longest thresholds."""
EMPTY: Final = -(1 << 30)
"""Stands for a threshold that has not been drawn: nothing added to it is positive."""

SMALLEST: Final = 126 << 7
"""Sign, exponent and seven bits of 0.5f: where the table begins."""
SIDE: Final = 32 * 128 + 1
"""Knots on each side of the median: 128 to each octave from 1/2 to 2^31."""


def _spread(exact: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The knots of `interval_table` in the order of the bits of a float32, one for each of 128 steps
    of every octave. Below 128 only whole words occur, so what stands between them is never used.
    """
    y = np.ldexp(1 + np.arange(SIDE) % 128 / 128, np.arange(SIDE) // 128 - 1)
    whole = np.where(y < 1, 0, np.floor(y)).astype(np.int64)
    octave = np.maximum(np.frexp(whole)[1] - 8, 0)
    index = (octave << 7) + (whole >> octave)
    return exact.reshape(2, KNOTS)[:, index].ravel()


@dataclass(frozen=True, eq=False)
class Units:
    """bits: 2^bits units are the nominal threshold. table: quantiles in units, (2 SIDE + 1,) int32;
    the last is the last but one again. top: the longest threshold, in units."""

    bits: int
    table: npt.NDArray[np.int32]
    top: int

    @property
    def one(self) -> int:
        """The nominal threshold."""
        return 1 << self.bits

    @property
    def smallest(self) -> int:
        """The shortest threshold that can be drawn."""
        return int(self.table.min())


def _first_table(model: ExactModel) -> npt.NDArray[np.int64]:
    return model._first_table() if INITIAL_CHARGE in model.effects else model.table()


def units_of(model: ExactModel) -> Units:
    """Units and table for a model's thresholds."""
    if not model.noisy:
        return Units(BITS, np.full(2, 1 << BITS, np.int32), 1 << BITS)
    knots = _spread(model.table())
    longest = int(max(knots.max(), _first_table(model).max()))
    bits = min(BITS, floor(_LONGEST - log2(longest / model.q)))
    units = np.maximum(np.rint(knots * (2.0**bits / model.q)), 1).astype(np.int32)
    top = int(np.ceil(longest * (2.0**bits / model.q))) + 1
    return Units(bits, np.append(units, units[-1:]), top)


def quantile(table: npt.NDArray[np.int32], word: npt.NDArray[np.uint32]) -> npt.NDArray[np.int32]:
    """Threshold in units for each random word: the plain form of the kernel's `quantile`.

    The distance y from the nearer end of (0, 1) as a float is the index: exponent and seven bits are
    the knot, the other sixteen the way to the next.
    """
    word = np.asarray(word, np.uint32)
    upper = (word >> np.uint32(31)).astype(np.int64)
    y = np.where(upper == 1, ~word, word).astype(np.float32)
    bits = np.maximum(y, np.float32(0.5)).view(np.uint32)
    index = upper * SIDE + (bits >> np.uint32(16)).astype(np.int64) - SMALLEST
    part = (bits & np.uint32(0xFFFF)).astype(np.float32)
    low = table[index]
    step = (table[index + 1] - low).astype(np.float32)
    return low + (step * part * np.float32(2.0**-16)).astype(np.int32)


def drawn(
    units: Units, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32], seed: int
) -> npt.NDArray[np.int32]:
    """Threshold of spike k of each pixel: the word of the exact tier, looked up in units."""
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, SHOT_NOISE.stream))
    return quantile(units.table, np.choose((k & np.uint64(3)).astype(np.intp), words))


def first_charge(
    model: ExactModel, units: Units, pixels: npt.NDArray[np.uint32], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.int32]:
    """State before the first cycle: the exact tier's, rounded, for pixels with these flags."""
    steady = replace(
        model, effects=tuple(e for e in model.effects if e is not SHOT_NOISE), threshold_noise=0.0
    )
    scale = 2.0**units.bits / model.q
    noisy = np.rint(model.initial(pixels).deficit * scale)
    at_mean = steady.initial(pixels).deficit
    phase = np.floor((1 - (at_mean + 1) / model.q) * 2.0**32).astype(np.int64).astype(np.uint32)
    deficit = np.where(flags & NOISE, noisy, np.rint(at_mean * scale)).astype(np.int32)
    return np.where(flags == 0, phase.view(np.int32), deficit)


def running(
    model: ExactModel, k: npt.NDArray[np.uint64], pixels: npt.NDArray[np.uint32]
) -> npt.NDArray[np.float64]:
    """Threshold of the running interval k of each pixel, in nominal thresholds."""
    from sensor.effects.shot_noise import thresholds

    table: Any = model.table()
    later = thresholds(table, k, pixels, model.seed)
    first = thresholds(_first_table(model), k, pixels, model.seed)
    return np.where(k == 0, first, later) / model.q
