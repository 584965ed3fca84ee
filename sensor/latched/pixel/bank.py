"""A bank of thresholds: a small table from which a pixel that fires in a cycle takes its next one.

The bank holds one threshold for each of SIZE equal shares of probability: the mean of the
distribution within the share, stretched about the mean of all so that mean and variance are those
of the distribution. Its range is finite: 3.7 standard deviations of a normal variate.

A draw belongs to a group of LANES neighbours and to a cycle. All pixels of a group read one stretch
of the bank, whose offset is drawn for each cycle, and each pixel reads the entry of its lane. In
the order of the bank, entries 1 to LANES - 1 apart are uncorrelated, so neighbours that fire in the
same cycle are too. An offset is the top bits of a linear congruential generator, which steps with
each cycle and starts anew with every WORD cycles from a hash of seed, group and cycle. It therefore
does not depend on how a run is split, and any cycle can be reached in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.compute.table_cache import cached_table
from sensor.latched.pixel.charge import Charge
from sensor.latched.pixel.interval import KNOTS, knot_places
from sensor.latched.pixel.model import ExactModel

LANES: Final = 16
"""Pixels of a group: a 512-bit vector of 32-bit integers."""
_BITS: Final = 12
SIZE: Final = 1 << _BITS
"""Thresholds of a bank; with 32 bits each they fit in a first-level cache."""
WORD: Final = 32
"""Cycles after which the generator starts anew."""
PERIOD: Final = 1 << 31
"""Cycles after which the draws of a group repeat: 15 hours at 40 kHz."""
_MULTIPLIER: Final = 747796405
_INCREMENT: Final = 2891336453
"""Generator of 32 bits: those of PCG-32 (O'Neill, HMC-CS-2014-0905, 2014)."""
WEYL: Final = 0x9E3779B9
"""2^32 over the golden ratio: spreads the numbers of consecutive words of cycles."""
_SCRAMBLE: Final = ((16, 0x7FEB352D), (15, 0x846CA68B))
"""Shifts and factors of a 32-bit hash with low bias, by C. Wellons' search (hash-prospector)."""

WIDEST: Final = 0.15
"""Largest standard deviation of a threshold, relative, for which there is a bank. The tails of
wider distributions matter too much, and their lowest entries would have to end at 0."""
_CORRELATION: Final = 4e-6
"""Correlation at each lag at which the search for an order ends."""
_TRIALS: Final = 400_000
"""Most exchanges of two entries that are tried; some ten thousand are needed."""
_FINE: Final = 1 << 15
"""Scale of the entries in the search, whose sums are exact integers: the largest distance from the
mean."""

GENERATOR: Final = {
    "BANK_BITS": _BITS, "PERIOD": PERIOD, "WEYL": WEYL,
    "SHIFT_1": _SCRAMBLE[0][0], "FACTOR_1": _SCRAMBLE[0][1],
    "SHIFT_2": _SCRAMBLE[1][0], "FACTOR_2": _SCRAMBLE[1][1],
}  # fmt: skip
"""The constants by the names that they have in kernels."""

Values = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint32]


def _side(table: Charge) -> tuple[Values, Values]:
    """Integrals of the thresholds of one side of the median, and of their squares, over each share,
    (SIZE / 2,), from the end of the distribution to the median.

    Between knots the threshold is linear in the distance from the end, so the integrals are exact.
    """
    place = np.append(0.0, knot_places() + 0.5)  # the word y stands for y + 1/2
    edges = np.linspace(0, 2.0**31, SIZE // 2 + 1)
    value = table.astype(np.float64)
    value = np.append(value[0], value)
    cuts = np.unique(np.concatenate([place[place < 2.0**31], edges]))
    there = np.interp(cuts, place, value)
    a, b, width = there[:-1], there[1:], np.diff(cuts)
    share = np.searchsorted(edges, cuts[:-1], "right") - 1
    first = np.bincount(share, (a + b) / 2 * width)
    second = np.bincount(share, (a * a + a * b + b * b) / 3 * width)
    return np.asarray(first), np.asarray(second)


@dataclass(frozen=True, eq=False)
class _Shares:
    """Equal shares of a distribution, in the unit of its table; differences from its median.

    Attributes:
        centre: the median.
        means: (SIZE,) ascending, mean of each share.
        square: mean of the squares.
    """

    centre: float
    means: Values
    square: float

    @property
    def stretched(self) -> Values:
        """The means, stretched about the mean of all to the variance of the distribution."""
        mean, variance = self.means.mean(), self.means.var()
        stretch = math.sqrt((self.square - mean * mean) / variance) if variance > 0 else 1.0
        return np.asarray(mean + (self.means - mean) * stretch)

    @property
    def distance(self) -> float:
        """RMS difference of a threshold from the stretched mean of its share."""
        bank = self.stretched
        return math.sqrt(self.square - 2 * (bank * self.means).mean() + (bank * bank).mean())


def _shares(table: Charge) -> _Shares:
    """The shares of the thresholds of a table of quantiles."""
    sides = table.reshape(2, KNOTS)
    centre = float(sides[0, -1])  # differences from the median keep their digits
    parts = [_side(side - np.int64(centre)) for side in sides]
    width = 2.0**32 / SIZE
    means = np.concatenate([parts[0][0], parts[1][0][::-1]]) / width
    return _Shares(centre, means, float((parts[0][1].sum() + parts[1][1].sum()) / 2.0**32))


def _rounded(values: Values) -> npt.NDArray[np.int64]:
    """Integers that have the sum of these values to half a unit: after rounding, some are moved by
    one, from the middle of the list on, where the values lie closest together."""
    whole = np.rint(values).astype(np.int64)
    excess = round(float((values - whole).sum()))
    middle = (values.size - abs(excess)) // 2
    whole[middle : middle + abs(excess)] += np.sign(excess)
    return whole


def _order(ascending: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The thresholds in an order without correlation at lags 1 to LANES - 1, (SIZE,)."""
    from sensor.latched.pixel.bank_order import uncorrelate  # numba, which starts slowly

    place = np.random.default_rng(1).permutation(ascending.size)
    about = ascending - ascending.mean()
    fine = np.rint(about * (_FINE / max(np.abs(about).max(), 1))).astype(np.int64)
    x = np.empty_like(fine)
    x[place] = fine
    limit = round(_CORRELATION * float((fine * fine).sum()))
    uncorrelate(x, place, np.zeros(LANES - 1, np.int64), limit, _TRIALS)
    out = np.empty_like(ascending)
    out[place] = ascending
    return out


@dataclass(frozen=True, eq=False)
class Bank:
    """Thresholds of a bank in units of which 2^bits are the nominal threshold.

    Attributes:
        values: (SIZE + LANES,) int32; the first LANES follow once more after the last.
        shortest, top: shortest and longest threshold.
    """

    values: npt.NDArray[np.int32]
    shortest: int
    top: int

    def draw(
        self, groups: Words, lanes: Words, cycles: Words, crossing: int, seed: int
    ) -> npt.NDArray[np.int32]:
        """Thresholds of pixels that fire, (n,) units.

        Args:
            groups: (n,) number of the first pixel of each pixel's group on the chip.
            lanes: (n,) place of each pixel in its group.
            cycles: (n,) cycle in which each pixel fires.
            crossing: thresholds that the pixel has crossed before in this cycle.
            seed: seed of the run.
        """
        return self.values[offsets(groups, cycles, crossing, seed) + lanes]


def has_bank(model: ExactModel) -> bool:
    """Whether there is a bank for a model: it has noise, and its thresholds spread by at most
    WIDEST."""
    variance = model.shot * model.threshold + model.threshold_noise**2
    return bool(0 < variance <= (WIDEST * model.mean) ** 2)


def bank_of(model: ExactModel, bits: int) -> Bank:
    """The bank of a model, in units of which 2^bits are the nominal threshold.

    Raises:
        ValueError: the model has none; see `has_bank`.
    """
    if not has_bank(model):
        raise ValueError(
            f"thresholds of a bank must spread by 0 to {WIDEST:g}, not those of "
            f"{model.threshold:g} e with noise of {model.threshold_noise:g} e"
        )
    return _bank(plain_model(model), bits)


def bank_distance(model: ExactModel) -> float:
    """RMS difference of a threshold from the entry of the bank in whose share of the distribution
    it lies, relative to the mean threshold. A bank of thresholds and independent draws that are
    paired in this way differ by no more."""
    return _distance(plain_model(model))


def plain_model(model: ExactModel) -> ExactModel:
    """A model without what does not change its thresholds."""
    noise = tuple(effect for effect in model.effects if effect.stream is Stream.SHOT_NOISE)
    return replace(model, seed=0, effects=noise, reset="residual", dead_time=0.0, transfers=())


@lru_cache(maxsize=32)
def _distance(model: ExactModel) -> float:
    shares = _shares(model.table())
    return shares.distance / (shares.centre + float(shares.means.mean()))


@lru_cache(maxsize=32)
def _bank(model: ExactModel, bits: int) -> Bank:
    shares = _shares(model.table())
    ascending = _rounded((shares.centre + shares.stretched) * (2.0**bits / model.q))
    sources = __file__, str(Path(__file__).with_name("bank_order.py"))
    key = (ascending.tobytes(),)
    values = cached_table("bank", key, sources, lambda: _order(ascending).astype(np.int32))
    values = np.append(values, values[:LANES])
    values.setflags(write=False)
    return Bank(values, int(ascending[0]), int(ascending[-1]))


def groups_of(numbers: Words, shape: tuple[int, int]) -> tuple[Words, Words]:
    """Number of the first pixel of the group of each pixel of a plane, and its place in the group,
    (H W,) each. numbers: (H W,) of the pixels; shape: (H, W)."""
    height, width = shape
    lanes = np.arange(width, dtype=np.uint32) % np.uint32(LANES)
    first = numbers.reshape(shape)[:, np.arange(width) // LANES * LANES]
    return first.ravel().astype(np.uint32), np.tile(lanes, height)


def scrambled(word: Words) -> Words:
    """A hash of 32-bit words; different words have different hashes."""
    for shift, factor in _SCRAMBLE:
        word = (word ^ (word >> np.uint32(shift))) * np.uint32(factor)
    return word ^ (word >> np.uint32(16))


def _steps() -> tuple[Words, Words]:
    """Factor and summand that lead from the start of a word to each of its cycles, (WORD,)."""
    factor, summand = [1], [0]
    for _ in range(WORD - 1):
        factor.append(factor[-1] * _MULTIPLIER % 2**32)
        summand.append((summand[-1] * _MULTIPLIER + _INCREMENT) % 2**32)
    return np.array(factor, np.uint32), np.array(summand, np.uint32)


STEPS: Final = np.stack(_steps())
"""(2, WORD) uint32: factors and summands."""
STEPS.setflags(write=False)


def group_keys(groups: Words, seed: int) -> Words:
    """Hashes of groups, (n,) uint32, which start their generators together with the cycle."""
    return scrambled(np.asarray(groups, np.uint32) ^ scrambled(np.array([seed], np.uint32)))


def offsets(groups: Words, cycles: Words, crossing: int, seed: int) -> Words:
    """Offset in the bank of each group in a cycle, (n,) uint32: the numpy form of the kernels'.

    The first crossing of a cycle takes the top bits of the generator, the second those in the
    middle, and further ones those of a hash. Arguments: see `Bank.draw`.
    """
    cycles = np.atleast_1d(cycles).astype(np.uint32) & np.uint32(PERIOD - 1)
    state = scrambled(group_keys(groups, seed) ^ ((cycles >> np.uint32(5)) * np.uint32(WEYL)))
    at = cycles & np.uint32(WORD - 1)
    state = STEPS[0][at] * state + STEPS[1][at]
    if crossing > 1:
        state = scrambled(state + np.uint32(crossing))
    if crossing == 1:
        return np.asarray((state >> np.uint32(8)) & np.uint32(SIZE - 1))
    return np.asarray(state >> np.uint32(32 - _BITS))
