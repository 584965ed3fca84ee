"""Interval histograms of recordings against those of the model with the same parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.interval_law import latched_probabilities
from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]
_PIXELS: Final = 4096
"""Pixels of a comparison at most, evenly spaced."""
_EXPECTED: Final = 50.0
"""Intervals that a bin must be expected to have; others are merged with their neighbour."""
_LONGEST: Final = 400
"""Longest interval with a bin of its own, cycles."""
_RANK: Final = 1e-9
_LEAST_SPREAD: Final = 2e-4
_LEAST_SKEW: Final = 4e-3


@dataclass(frozen=True, eq=False)
class Histogram:
    """Intervals of one recording and of the model.

    Attributes:
        name: name of the recording.
        rate: spikes a cycle.
        measured, model: (longest + 1,) intervals of 1, 2, ... cycles, the last one longer ones.
        chi_square: distance of the two, over the covariance of pixels.
        bins: degrees of freedom.
        chance: chance of a larger distance if the model is true.
        worst: interval whose number differs most, in standard errors.
    """

    name: str
    rate: float
    measured: Values
    model: Values
    chi_square: float
    bins: int
    chance: float
    worst: int

    @property
    def off(self) -> float:
        """Share of the intervals that would have to change: half the sum of differences."""
        return float(np.abs(self.measured - self.model).sum() / 2 / self.measured.sum())


def compare_histograms(
    trains: Trains, good: npt.NDArray[np.bool_], squared: float, third: float, dead: float
) -> Histogram | None:
    """The histogram of a recording of constant light against the model.

    Every pixel has its own mean interval, measured; noise and dead time are those of the camera.
    Intervals of a pixel are correlated (they share latched ends), so the covariance of the
    differences is that of pixels, and the distance d' S^-1 d has the chi-square law. The
    measured mean has an error, by which the model's law is too wide by half its second derivative
    times the variance of the mean; it is taken off.

    Args:
        trains: the recording.
        good: (n,) bool, pixels without defects.
        squared: sigma^2 of an interval.
        third: 1/Q^2, see noise.py.
        dead: dead time, cycles.

    Returns:
        None if there are too few intervals.
    """
    from scipy.stats import chi2

    chosen = np.flatnonzero(good & (trains.spikes > 8))
    chosen = chosen[:: -(-max(len(chosen), 1) // _PIXELS)]
    if len(chosen) < 50:
        return None
    used = np.zeros_like(good)
    used[chosen] = True
    mean, number = trains.intervals[chosen], trains.spikes[chosen] - 1
    longest = min(int(3 * np.quantile(mean, 0.99)) + 2, _LONGEST)
    measured = trains.histogram(longest, used).astype(np.float64)
    spread = max(np.sqrt(max(squared, 0.0)), _LEAST_SPREAD)
    skew = float(np.clip(2 * max(third, 0.0) / spread**3, _LEAST_SKEW, 2 * spread))
    error = np.sqrt(spread**2 * (mean - dead) ** 2 / number + 1 / (6 * number**2))
    laws = [
        latched_probabilities(mean + shift, spread, skew, dead, longest)
        for shift in (0.0, error, -error)
    ]
    model = number[:, None] * (2 * laws[0] - (laws[1] + laws[2]) / 2)
    total = model.sum(axis=0)
    edges, held = [0], 0.0
    for bin_, expected in enumerate(total):
        held += expected
        if held >= _EXPECTED:
            edges.append(bin_ + 1)
            held = 0.0
    edges[-1] = len(total)
    if len(edges) < 3:
        return None
    off = np.add.reduceat(measured - model, edges[:-1], axis=1)
    difference, products = off.sum(axis=0), off.T @ off
    size = np.sqrt(np.maximum(np.diag(products), 1.0))
    values, vectors = np.linalg.eigh(products / np.outer(size, size))
    kept = values > _RANK * values[-1] * len(values)
    part = vectors[:, kept].T @ (difference / size)
    distance = float((part**2 / values[kept]).sum())
    bins = int(kept.sum())
    worst = int(np.argmax(np.abs(difference) / size))
    return Histogram(
        trains.name, trains.rate, measured.sum(axis=0), total, distance, bins,
        float(chi2.sf(distance, bins)), edges[worst] + 1,
    )  # fmt: skip
