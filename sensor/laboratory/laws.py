"""Laws of a recording of still light: intervals, fixed pattern, and what pixels have in common.

A recording shows more of a camera than its variances. Noise that accumulates (of thresholds) gives
successive intervals a correlation of 0, and timing noise of the latch gives -1/2; so the
correlation tells the two apart (Cox and Lewis, The Statistical Analysis of Series of Events, 1966).
Pixels are compared with the median of their surroundings, because the scene is not uniform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.errors import InputError
from cosim.spikes.viform import SpikeStream, words_for

MEANS: Final = (2.5, 3.0, 4.0, 6.0, 8.0)
"""Mean intervals whose pixels are pooled, cycles."""
WITHIN: Final = 0.1
"""Pixels whose mean interval is within this of one of MEANS are pooled, cycles."""
LONGEST: Final = 64
"""Longest interval of a histogram, cycles; longer ones count as this long."""
STILL_CORRELATION: Final = 0.2
"""Largest correlation of successive intervals that noise of still light is taken for. Noise of a
pixel makes it 0 or less; light that changes over many intervals, positive."""
STILL_COMMON: Final = 100.0
"""Largest common variance that a drift of the gain under still light is taken for; a recorded chip
has 13."""
_LEAST: Final = 8
"""Fewest intervals of a pixel that counts."""
_POOLED: Final = 30
"""Fewest pixels of a class whose correlation tells of the light."""
_BYTES: Final = 1 << 30
"""Bytes of a stream that are read at most."""
_AROUND: Final = 5
"""Side of the square whose median a pixel is compared with, pixels."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class IntervalLaw:
    """The intervals of all pixels with about the same mean interval.

    Attributes:
        mean: centre of the class, cycles.
        pixels: number of pixels.
        variance: variance of an interval about the mean of its pixel, cycles^2.
        correlation: correlation of successive intervals of a pixel.
        histogram: share of intervals of 1 to LONGEST cycles, (LONGEST,).
    """

    mean: float
    pixels: int
    variance: float
    correlation: float
    histogram: Values


@dataclass(frozen=True)
class Laws:
    """The laws of a recording.

    Attributes:
        cycles: number of cycles that were read.
        rate: spikes a cycle of each pixel, (H, W): the inverse of its mean interval, or its spikes
            over the cycles if it has few intervals.
        excess: rate over the median of the surroundings, less 1, (H, W); NaN in dark surroundings.
        intervals: the classes of MEANS with pixels.
        spread, kurtosis: standard deviation and kurtosis of `excess`; a normal law has 3.
        core: its spread by the median of its size (times 1.4826), without its tails.
        rows, columns: standard deviation of its medians over rows, and over columns.
        neighbours: correlation of `excess` between neighbours in a row, and in a column.
        above, below: number of pixels with an excess above 0.15, and below -0.15.
        highest: largest rate above the surroundings, spikes a cycle.
        common: variance of the count of a frame over that of independent pixels.
    """

    cycles: int
    rate: Values
    excess: Values
    intervals: tuple[IntervalLaw, ...]
    spread: float
    kurtosis: float
    core: float
    rows: float
    columns: float
    neighbours: tuple[float, float]
    above: int
    below: int
    highest: float
    common: float

    @property
    def motion(self) -> str | None:
        """Why the light cannot have been still; None if it may have been."""
        known = [law.correlation for law in self.intervals if law.pixels >= _POOLED]
        most = max((c for c in known if np.isfinite(c)), default=0.0)
        told = []
        if most > STILL_CORRELATION:
            told.append(f"successive intervals correlate by +{most:.2g}")
        if self.common > STILL_COMMON:
            told.append(f"the common noise is {self.common:.3g}")
        return " and ".join(told) or None

    def document(self) -> dict[str, Any]:
        """The laws for JSON, without the arrays of pixels."""
        return {
            "cycles": self.cycles, "height": self.rate.shape[0], "width": self.rate.shape[1],
            "rate": float(self.rate.mean()), "spread": self.spread, "core_spread": self.core,
            "kurtosis": self.kurtosis, "row_spread": self.rows, "column_spread": self.columns,
            "neighbours": list(self.neighbours), "above": self.above, "below": self.below,
            "highest": self.highest, "common_variance": self.common,
            "intervals": [
                {
                    "mean": law.mean, "pixels": law.pixels, "variance": law.variance,
                    "correlation": law.correlation, "histogram": law.histogram.tolist(),
                }
                for law in self.intervals
            ],
        }  # fmt: skip


@njit(cache=True, nogil=True)
def _intervals(words, cycles, longest, counts, sums, products, histogram):  # type: ignore[no-untyped-def]
    """Statistics of the intervals of each pixel.

    Args:
        words: (pixels, words), pixel-major.
        cycles: number of cycles.
        longest: last bin of the histograms.
        counts: (pixels,) number of intervals, written.
        sums: (pixels, 2) sum of the intervals, and of their squared deviations, written.
        products: (pixels,) sum of products of successive deviations, written.
        histogram: (pixels, longest) int32, written.
    """
    at = np.empty(cycles, np.int64)
    for pixel in range(words.shape[0]):
        n = 0
        for cycle in range(cycles):
            if (words[pixel, cycle >> 5] >> np.uint32(cycle & 31)) & np.uint32(1):
                at[n] = cycle
                n += 1
        if n < 2:
            continue
        mean = (at[n - 1] - at[0]) / (n - 1)
        square = product = last = 0.0
        for k in range(n - 1):
            interval = at[k + 1] - at[k]
            off = interval - mean
            square += off * off
            if k > 0:
                product += off * last
            last = off
            histogram[pixel, min(interval, longest) - 1] += 1
        counts[pixel] = n - 1
        sums[pixel, 0], sums[pixel, 1] = at[n - 1] - at[0], square
        products[pixel] = product


def measure_laws(stream: SpikeStream) -> Laws:
    """Measures the laws of a stream of still light, of its first GiB if it is longer.

    Raises InputError for a stream of fewer than 64 cycles or without spikes.
    """
    height, width = stream.shape
    most = max(_BYTES // (4 * height * width), 2) * 32
    cycles = min(stream.cycles, most)
    if cycles < 64:
        raise InputError("the stream", "of 64 cycles or more", f"{cycles}", "record longer")
    read = stream.read_words(0, words_for(cycles))
    words = np.ascontiguousarray(read.reshape(len(read), -1).T)
    counts, products = np.zeros(len(words), np.int64), np.zeros(len(words))
    sums, histogram = np.zeros((len(words), 2)), np.zeros((len(words), LONGEST), np.int32)
    _intervals(words, cycles, LONGEST, counts, sums, products, histogram)
    spikes = np.bitwise_count(words).sum(axis=1, dtype=np.int64)
    if not spikes.any():
        raise InputError("the stream", "one with spikes", "none", "record brighter light")
    rate = spikes / cycles
    np.divide(counts, sums[:, 0], out=rate, where=counts >= _LEAST)
    rate = rate.reshape(height, width)
    return Laws(
        cycles=cycles,
        rate=rate,
        intervals=_classes(counts, sums, products, histogram),
        common=_common(read, cycles),
        **_pattern(rate),
    )


def _classes(
    counts: npt.NDArray[np.int64], sums: Values, products: Values, histogram: npt.NDArray[np.int32]
) -> tuple[IntervalLaw, ...]:
    """The laws of intervals, for pixels with _LEAST intervals or more."""
    mean = np.divide(sums[:, 0], counts, out=np.zeros(len(counts)), where=counts > 0)
    laws = []
    for centre in MEANS:
        chosen = (np.abs(mean - centre) <= WITHIN) & (counts >= _LEAST)
        if not chosen.any():
            continue
        n, total = int(chosen.sum()), int(counts[chosen].sum())
        shares = histogram[chosen].sum(axis=0) / total
        variance = float(sums[chosen, 1].sum()) / total
        covariance = float(products[chosen].sum()) / (total - n)
        # About a pixel's own mean of m intervals, both are too low by the variance of that mean,
        # (variance + 2 covariance) / m, if only successive intervals correlate.
        own = max(variance + 2 * covariance, 0.0) / (total / n - 3)
        variance, covariance = variance + own, covariance + own
        correlation = covariance / variance if variance > 0 else float("nan")
        laws.append(IntervalLaw(centre, n, variance, correlation, shares))
    return tuple(laws)


def _pattern(rate: Values) -> dict[str, Any]:
    """The fields of `Laws` about the fixed pattern."""
    from scipy.ndimage import median_filter

    around = median_filter(rate, _AROUND, mode="nearest")
    excess = np.full(rate.shape, np.nan)
    np.divide(rate, around, out=excess, where=around > 0)
    excess -= 1
    known = excess[np.isfinite(excess)]
    spread = float(known.std())
    fourth = float(((known - known.mean()) ** 4).mean())
    core = 1.4826 * float(np.median(np.abs(known - np.median(known))))
    rows, columns = (float(np.nanmedian(excess, axis=axis).std()) for axis in (1, 0))
    pairs = (excess[:, :-1], excess[:, 1:]), (excess[:-1], excess[1:])
    return {
        "excess": excess, "spread": spread, "core": core, "rows": rows, "columns": columns,
        "kurtosis": fourth / spread**4 if spread else float("nan"),
        "neighbours": tuple(_correlation(a, b, core) for a, b in pairs),
        "above": int((known > 0.15).sum()), "below": int((known < -0.15).sum()),
        "highest": float((rate - around).max()),
    }  # fmt: skip


def _correlation(a: Values, b: Values, core: float) -> float:
    """Correlation of pairs, both within five spreads of the core: few warm pixels would rule it."""
    near = (np.abs(a) < 5 * core) & (np.abs(b) < 5 * core)
    if near.sum() < 3:
        return float("nan")
    return float(np.corrcoef(a[near], b[near])[0, 1])


def _common(read: npt.NDArray[np.uint32], cycles: int) -> float:
    """Variance of the frames' counts over that of independent pixels, for sums of 64 cycles, in
    which the phases of the pixels average out."""
    whole = cycles // 64
    if whole < 3:
        return float("nan")
    blocks = np.bitwise_count(read[: 2 * whole]).reshape(whole, 2, *read.shape[1:])
    each = blocks.sum(axis=1, dtype=np.int64)
    frames = each.sum(axis=(1, 2))
    alone = each.var(axis=0, ddof=1).sum()
    return float(frames.var(ddof=1) / alone) if alone > 0 else float("nan")
