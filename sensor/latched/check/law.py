"""The law of the spikes of a camera, measured on patches against that of another one.

Two cameras with the same light but other draws agree in their distributions alone: in the mean and
the variance of rates, in the latched intervals, and in the correlation of pixels. Each change comes
with the limits that follow from its scatter over the rows of the patches, which are independent:
the pixels of a row share their draws from the bank. A third camera, which has no noise, gives the
rates about which the noise is taken.

What noise from the bank changes against a draw for each spike is also measured in the
unit of the error of a run, relative to the rate (`bank_change`): the mean of the difference of two
cameras that are equal otherwise, and the difference of their standard deviations. Both are averages
over all patches and windows, with the intervals that follow from their scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.plan.error import CONFIDENCE, Law, LawFigure
from cosim.plan.paired import Values, Words

LONGEST: Final = 1024
"""Cycles from which on all intervals count as equal."""

DOUBT: Final = 1e-6
"""Chance that an interval does not include the true change. A run beyond it is repeated without the
bank, which must not happen by chance."""


@njit(cache=True, nogil=True)
def _count(words, cycles, start, size, last, counts):  # type: ignore[no-untyped-def]
    for pixel in range(words.shape[1]):
        before, patch = last[pixel], pixel // size
        for n in range(words.shape[0]):
            at, word = start + 32 * n, words[n, pixel]
            for cycle in range(at, min(at + 32, start + cycles)):
                if word == 0:
                    break
                if word & 1:
                    if before >= 0:
                        counts[patch, min(cycle - before, counts.shape[1] - 1)] += 1
                    before = cycle
                word >>= 1
        last[pixel] = before


class Intervals:
    """Latched intervals of a camera on patches.

    Attributes:
        counts: (patches, LONGEST + 1) int64, intervals by their cycles.
    """

    def __init__(self, patches: int, pixels: int) -> None:
        self._size, self._last = pixels // patches, np.full(pixels, -1, np.int64)
        self.counts = np.zeros((patches, LONGEST + 1), np.int64)

    def add(self, words: Words, start: int, cycles: int) -> None:
        """Counts those that end in the next cycles. words: (ceil(cycles / 32), pixels)."""
        _count(words, cycles, start, self._size, self._last, self.counts)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        return {"last": self._last.copy(), "counts": self.counts.copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        self._last, self.counts = state["last"].copy(), state["counts"].copy()


@dataclass(frozen=True, eq=False)
class Spread:
    """What a camera has filmed on patches.

    Attributes:
        whole: (patches, pixels) rate of the whole run, spikes a cycle.
        rates: (windows, patches, pixels) rates of windows, less those without noise.
        counts: (patches, n) latched intervals by their cycles.
        columns: pixels of a row of a patch.
    """

    whole: Values
    rates: Values
    counts: npt.NDArray[np.int64]
    columns: int


def _scattered(changes: Values, doubt: float) -> LawFigure:
    """The mean of the changes of rows, (patches, rows), with the limits of their scatter within the
    patches."""
    from scipy.special import stdtrit

    patches, rows = changes.shape
    square = float(changes.var(axis=1, ddof=1).sum()) / rows
    width = -float(stdtrit(patches * (rows - 1), doubt / 2)) * math.sqrt(square) / patches
    value = float(changes.mean())
    return LawFigure(value, (value - width, value + width))


def _rows(values: Values, columns: int) -> Values:
    """Values of pixels, (..., patches, pixels), by rows, (..., patches, rows, columns)."""
    return values.reshape(*values.shape[:-1], -1, columns)


def _noise(seen: Spread, base: Values) -> tuple[Values, Values]:
    """Variance of the rate of a pixel in a window, and covariance of two pixels of a row, relative
    to the square of the rate, (patches, rows) each; about the mean of each patch."""
    noise = seen.rates / base
    rows = _rows(noise - noise.mean(axis=-1, keepdims=True), seen.columns)
    square = (rows**2).sum(axis=-1)
    pairs = (rows.sum(axis=-1) ** 2 - square).mean(axis=0)
    many = seen.columns
    return square.mean(axis=0) / many, pairs / (many * max(many - 1, 1))


def _apart(one: npt.NDArray[np.int64], other: npt.NDArray[np.int64], doubt: float) -> LawFigure:
    """Total variation distance of intervals, (patches, n) counts each.

    The distance of two samples is larger than that of their laws, by the scatter of each share,
    which is read off the patches.
    """
    from scipy.special import ndtri

    change = one / max(one.sum(), 1) - other / max(other.sum(), 1)
    found = float(np.abs(change.sum(axis=0)).sum()) / 2
    scatter = np.sqrt((change**2).sum(axis=0))
    chance = float(scatter.sum()) / math.sqrt(2 * math.pi)
    width = -float(ndtri(doubt / 2)) * float(np.sqrt((scatter**2).sum())) / 2
    low, value = max(found - chance - width, 0.0), max(found - chance, 0.0)
    return LawFigure(value, (low, min(found + width, 1.0)))


def law_change(one: Spread, other: Spread, floor: float, doubt: float = 1 - CONFIDENCE) -> Law:
    """Changes of the law of `one` against that of `other`, two cameras on the same patches.

    Windows may overlap, so those of a row are one sample.

    Args:
        one, other: what the cameras have filmed on patches of two rows or more.
        floor: spikes a cycle, least rate to which a change is relative.
        doubt: chance that limits do not include the true change.
    """
    base = np.maximum(other.whole.mean(axis=1), max(floor, 1e-300))[:, None]
    mean = _rows((one.whole - other.whole) / base, one.columns).mean(axis=-1)
    (noise, pairs), (reference, before) = (_noise(each, base) for each in (one, other))
    size, own = max(float(reference.mean()), 1e-300), max(float(noise.mean()), 1e-300)
    return Law(
        _scattered(mean, doubt),
        _scattered((noise - reference) / size, doubt),
        _apart(one.counts, other.counts, doubt),
        _scattered(pairs / own - before / size, doubt),
    )


@dataclass(frozen=True)
class BankChange:
    """Changes by the bank, relative to the mean rate, with half widths of their intervals.

    Attributes:
        rate, rate_width: mean change of the rate.
        noise, noise_width: change of the standard deviation of a rate.
    """

    rate: float
    rate_width: float
    noise: float
    noise_width: float

    @property
    def value(self) -> float:
        """The larger change."""
        return max(abs(self.rate), abs(self.noise))

    @property
    def least(self) -> float:
        """The larger change, less its interval; 0 where the interval includes 0."""
        rate, noise = abs(self.rate) - self.rate_width, abs(self.noise) - self.noise_width
        return max(rate, noise, 0.0)


def bank_change(bank: Values, own: Values, noiseless: Values, floor: float) -> BankChange | None:
    """The change of rates by the bank, None with fewer than two patches.

    Windows may overlap, so the windows of a patch are one sample. Patches are independent.

    Args:
        bank, own, noiseless: (windows, patches, pixels) spikes a cycle, with noise from the bank,
            with a draw for each spike, and without noise.
        floor: spikes a cycle, least mean rate.
    """
    from scipy.special import stdtrit

    patches = bank.shape[1]
    if patches < 2:
        return None
    base = np.maximum(own.mean(axis=2, keepdims=True), max(floor, 1e-300))
    noise, reference = (bank - noiseless) / base, (own - noiseless) / base
    rates = (noise - reference).mean(axis=(0, 2))
    variance, other = (each.var(axis=2).mean(axis=0) for each in (noise, reference))
    both = (variance + other) / 2
    # Patches differ in their noise, so each contributes its relative change.
    sizes = math.sqrt(float(both.mean())) * (variance - other) / np.maximum(2 * both, 1e-300)
    score = -float(stdtrit(patches - 1, DOUBT / 2)) / math.sqrt(patches)
    return BankChange(
        float(rates.mean()), score * float(rates.std(ddof=1)),
        float(sizes.mean()), score * float(sizes.std(ddof=1)),
    )  # fmt: skip
