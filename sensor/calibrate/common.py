"""What pixels have in common: drift of the gain, duplicated rows, and a fixed pattern with rows,
columns and neighbours.

Drift: in sums of 64 cycles the counts of independent pixels add up to the sum of their variances.
What the counts of all together vary beyond it is the gain's, whose law is that of
sensor/latched/effects/drift.py: normal values KNOT cycles apart, linear in between. Its sample
variance over the sums has a mean and a variance that follow from their covariance C and that of
pixels, and takes the limits of a gamma law with these (Satterthwaite, Biometrics Bulletin 2:110,
1946).

Pattern: the mean products of the gains of neighbours, less noise, are their correlations, and the
variances of the means of rows and columns are those of independent pixels, of neighbours, and of
what a line has in common. sensor/device/pattern.py has the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.known import DEVIATIONS, Parameter, rooted
from sensor.calibrate.noise import drift_covariance
from sensor.calibrate.trains import LEAST_ROWS, SIGNIFICANT, Trains
from sensor.device.pattern import CORRELATED

Values = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.bool_]
BLOCK: Final = 64
"""Cycles of a sum of counts, in which the phases of the pixels average out."""
_LEAST_SUMS: Final = 4
_CHANCE: Final = 1e-3
"""Chance below which counts vary more than those of independent pixels."""


def duplicated_rows(trains: Trains) -> tuple[tuple[int, int], ...]:
    """Pairs (source, target) of rows with the same bits; the first of equal rows is the source.
    Rows in which nothing changes, dark or saturated, are not compared."""
    height, width = trains.shape
    rows = trains.words.reshape(height, width, -1)
    known: dict[bytes, int] = {}
    pairs = []
    spikes = trains.spikes.reshape(height, width)
    for row in range(height):
        told = spikes[row][(spikes[row] > 0) & (spikes[row] < trains.cycles)]
        if told.size < 2 or int(told.sum()) < BLOCK:
            continue
        source = known.setdefault(rows[row].tobytes(), row)
        if source != row:
            pairs.append((source, row))
    return tuple(pairs)


def originals(trains: Trains, pairs: Sequence[tuple[int, int]]) -> Pixels:
    """The pixels whose bits are their own, (n,): those of no target of `duplicated_rows`."""
    own = np.ones(trains.shape, bool)
    own[[target for _, target in pairs]] = False
    return own.ravel()


def duplicate_parameter(pairs: Sequence[tuple[int, int]]) -> Parameter:
    """Duplicated rows as pairs in text."""
    text = ", ".join(f"{target} shows {source}" for source, target in pairs) or "none"
    return Parameter(
        "duplicated_rows", "duplicated rows", text, (None, None), "1", True,
        "rows with the same bits in every cycle",
    )  # fmt: skip


@dataclass(frozen=True)
class Drift:
    """Drift of the gain that all pixels have in common.

    Attributes:
        size: RMS of the gain at a knot.
        ci: its limits at 95 %.
        known: whether the counts vary more than those of independent pixels.
        ratio: their variance over that of independent pixels.
        sums: sums of counts.
    """

    size: float
    ci: tuple[float, float | None]
    known: bool
    ratio: float
    sums: int


def measure_drift(trains: Trains, good: Pixels) -> Drift | None:
    """The drift in a recording of still light; None if it is too short. good: (n,) pixels."""
    from scipy.stats import chi2

    sums = trains.cycles // BLOCK
    if sums < _LEAST_SUMS:
        return None
    each = _sums(trains, good)
    whole = each.sum(axis=1).astype(np.float64)
    alone = float(each.var(axis=0, ddof=1).sum())
    variance, mean = float(whole.var(ddof=1)), float(whole.mean())
    if alone <= 0 or mean <= 0:
        return None
    centred = np.eye(sums) - 1 / sums
    shape = centred @ drift_covariance(BLOCK, sums) @ centred
    pixels = centred @ _neighbouring(each) @ centred
    pixels *= alone / mean**2 * (sums - 1) / np.trace(pixels)
    scale = float(np.trace(shape)) / (sums - 1)
    squared = max(variance - alone, 0.0) / (mean**2 * scale)

    def freedom(covariance: Values) -> float:
        """Degrees of freedom of the sample variance of sums with this covariance."""
        return float(np.trace(covariance) ** 2 / np.trace(covariance @ covariance))

    def limit(share: float, size: float) -> float:
        """Quantile of the sample variance with this drift, over that of independent pixels."""
        one = pixels + size * shape
        free = freedom(one)
        return float(np.trace(one) / (sums - 1) * chi2.ppf(share, free) / free)

    measured, free = variance / mean**2, freedom(pixels)
    known = bool(chi2.sf(free * variance / alone, free) < _CHANCE)
    low, high = (_root(limit, share, measured, squared) for share in (0.975, 0.025))
    return Drift(squared**0.5, (low or 0.0, high), known, variance / alone, sums)


def _neighbouring(each: npt.NDArray[np.int64]) -> Values:
    """Correlation of the sums of a pixel, (sums, sums): a spike that one of them gains, the next
    one loses, so that neighbours have down to -1/2. each: (sums, pixels)."""
    off = each - each.mean(axis=0)
    alike = float((off[1:] * off[:-1]).sum() / (off**2).sum())
    sums = len(each)
    return np.eye(sums) + np.clip(alike, -0.5, 0.5) * (np.eye(sums, k=1) + np.eye(sums, k=-1))


def _root(
    limit: Callable[[float, float], float], share: float, measured: float, near: float
) -> float | None:
    """The drift at which the quantile is what was measured; None if there is none."""
    from scipy.optimize import brentq

    if limit(share, 0.0) >= measured:
        return 0.0
    top = max(near, 1e-12)
    for _ in range(60):
        if limit(share, top) > measured:
            return float(brentq(lambda x: limit(share, x) - measured, 0.0, top)) ** 0.5
        top *= 4
    return None


def _sums(trains: Trains, good: Pixels) -> npt.NDArray[np.int64]:
    """Spikes in each BLOCK cycles, (sums, good pixels)."""
    size = BLOCK // 32
    return np.stack([
        np.bitwise_count(trains.words[good, n * size : (n + 1) * size]).sum(axis=1, dtype=np.int64)
        for n in range(trains.cycles // BLOCK)
    ])  # fmt: skip


def drift_parameter(drift: Drift | None) -> Parameter:
    """Drift of the gain that all pixels have in common."""
    if drift is None:
        return Parameter(
            "drift", "drift of the gain that all pixels have in common", None, (None, None), "1",
            False, "no recording of still light is long enough", "record 256 cycles or more",
        )  # fmt: skip
    value, ci = (drift.size, drift.ci) if drift.known else (0.0, (0.0, drift.ci[1]))
    return Parameter(
        "drift", "drift of the gain that all pixels have in common, RMS", value, ci, "1",
        True, f"counts of all pixels in {drift.sums} sums of {BLOCK} cycles vary {drift.ratio:.3g} "
        "times as those of independent pixels",
    )  # fmt: skip


@dataclass(frozen=True)
class Lines:
    """The pattern's rows, columns and neighbours: a value and its standard error each.

    Attributes:
        row, column: variance of the gain that a row, and a column, has in common.
        along_row, along_column: correlation of neighbours in a row, and in a column.
    """

    row: tuple[float, float]
    column: tuple[float, float]
    along_row: tuple[float, float]
    along_column: tuple[float, float]


def measure_lines(trains: Trains, good: Pixels, shade: Values, squared: float) -> Lines | None:
    """Rows, columns and neighbours of the pattern in a flat; None for fewer than eight lines.

    Args:
        trains: recording of constant uniform light.
        good: (n,) pixels.
        shade: (n,) shading of the light, relative.
        squared: sigma^2 of an interval, for the noise of a pixel's rate.
    """
    height, width = trains.shape
    if min(height, width) < LEAST_ROWS:
        return None
    rate = np.where(good, 1 / trains.intervals, np.nan)
    gain = (rate / np.nanmean(rate) - 1 - shade).reshape(height, width)
    number = float(trains.spikes[good].mean()) - 1
    interval = float(np.mean(trains.intervals[good]))
    noise = squared / number + (1 / 6) / (number * interval) ** 2
    found: list[tuple[float, float]] = []
    lines: list[tuple[float, float]] = []
    plane = gain + np.nanmean(gain)
    for axis in (1, 0):
        count = np.isfinite(gain).sum(axis=axis)
        mean = np.nansum(gain, axis=axis) / np.maximum(count, 1)
        told = count > 1
        lines.append((float(mean[told].var(ddof=1)), float(count[told].mean())))
        plane = plane - np.expand_dims(mean, axis)
    total = float(np.nanvar(plane))
    own = max(total - noise, 1e-12)
    for a, b in ((plane[:, :-1], plane[:, 1:]), (plane[:-1], plane[1:])):
        product = a * b
        pairs = int(np.isfinite(product).sum())
        value = float(np.nanmean(product)) / own
        value += own / total / (width if len(found) == 0 else height)  # of the means taken off
        found.append((value, total / own / pairs**0.5))
    (row, across), (column, down) = lines
    parts: list[tuple[float, float]] = []
    for (size, n), (alike, _) in zip(((row, across), (column, down)), found, strict=True):
        r = min(max(alike, 0.0), CORRELATED)
        expected = (own * (1 + 2 * r + 2 * _second(r)) + noise) / n
        m = height if len(parts) == 0 else width
        parts.append((size - expected, max(size, expected) * (2 / (m - 1)) ** 0.5))
    return Lines(parts[0], parts[1], found[0], found[1])


def _second(correlation: float) -> float:
    """Correlation of pixels two apart, of that of neighbours; see sensor/device/pattern.py."""
    if correlation <= 0:
        return 0.0
    a = (1 - (1 - 2 * correlation**2) ** 0.5) / (2 * correlation)
    return float(a * a / (1 + 2 * a * a))


def line_parameters(lines: Lines | None) -> list[Parameter]:
    """Rows, columns and neighbours of the pattern."""
    if lines is None:
        return []
    out = []
    for name, title, (square, error) in (
        ("row_fpn", "spread of the response that a row has in common", lines.row),
        ("column_fpn", "spread of the response that a column has in common", lines.column),
    ):
        value, ci = rooted(square, error)
        out.append(Parameter(
            name, title, value if square > SIGNIFICANT * error / 2 else 0.0, ci, "1", True,
            "variance of their means, less that of their pixels",
        ))  # fmt: skip
    for name, title, (value, error) in (
        ("neighbours_in_row", "correlation of neighbours in a row", lines.along_row),
        ("neighbours_in_column", "correlation of neighbours in a column", lines.along_column),
    ):
        ci = (max(value - DEVIATIONS * error, -1.0), min(value + DEVIATIONS * error, 1.0))
        told = value > SIGNIFICANT * error
        out.append(Parameter(
            name, title, min(value, CORRELATED) if told else 0.0, ci, "1", True,
            "mean product of the responses of neighbours, less noise, rows and columns",
        ))  # fmt: skip
    return out
