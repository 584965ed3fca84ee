"""Latched intervals under constant light: their closed forms (quantisation, variance, law), and the
histograms of recordings against them.

A pixel under constant light crosses thresholds at instants t_n whose differences are independent,
with mean m and standard deviation s (renewal process). The latch shows the crossing n in cycle
ceil(t_n). If the phase is uniform, as it is under light that does not divide a cycle, k intervals
X = t_(n+k) - t_n are latched as N = floor(X + U) with U uniform on [0, 1), so that

    E[N] = E[X],    var N = var X + q,    q = E[f (1 - f)],  f = X - floor X

(the variance of a Bernoulli variate of chance f). The Fourier series of f (1 - f) is 1/6 - sum
cos(2 pi j X) / (pi j)^2, so for X normal with mean M and variance V

    q(M, V) = 1/6 - sum_j cos(2 pi j M) exp(-2 pi^2 j^2 V) / (pi j)^2                            (1)

which is 1/6 once V is above 1/4. This is the "1/6 cycle^2" of two rounding errors of variance 1/12
(Bennett, Bell Syst. Tech. J. 27:446, 1948); it does not grow with k, while var X = k s^2 does. So
variances of sums of intervals separate the noise of a threshold from the rounding of the latch.

For n successive sums x_i of k intervals, var(sum of all) = n k s^2 + q(n k m), so

    E[sum (x_i - mean)^2] / (n - 1) = k s^2 + (n q(k m) - q(n k m) / n) / (n - 1)               (2)

exactly, whatever the correlation that the shared ends of neighbouring sums give them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]

_TERMS: Final = 100
"""Terms of a series at most; the rest of a third moment is below 3 / (2 pi^3 100^2) = 5e-6."""
_NARROW: Final = 0.05
"""Variance below which equation (1) is summed over integers, of which four matter, cycles^2; above,
five terms of the series leave 1e-17."""
_TAIL: Final = 8.0
"""Standard deviations beyond which a normal law has nothing: 1e-16."""


def latched_variance(mean: Values, variance: Values | float) -> Values:
    """q of equation (1), cycles^2.

    The series needs few terms for a wide law. For a narrow one, f (1 - f) is a parabola with kinks:
    with k the integer below M and y = X - k, it is y - y^2 + 2 sum (y - n)+ over n = 1, 2, ... + 2
    sum (n - y)+ over n = 0, -1, ..., and E[(y - n)+] of a normal y has a closed form.

    Args:
        mean: mean of the sum of intervals, cycles, any shape.
        variance: its variance, cycles^2, of that shape or a number.
    """
    mean = np.asarray(mean, np.float64)
    spread = np.sqrt(np.maximum(np.broadcast_to(variance, mean.shape), 0.0)).ravel()
    return np.asarray(_latched(mean.ravel(), spread).reshape(mean.shape))


@njit(cache=True, nogil=True)
def _latched(mean, spread):  # type: ignore[no-untyped-def]
    """See `latched_variance`; (n,) each, spread is the root of the variance."""
    q = np.empty(mean.shape)
    for pixel in range(mean.size):
        s = spread[pixel]
        if s * s < _NARROW:
            y = mean[pixel] - math.floor(mean[pixel])
            total = y - y * y - s * s
            for n in range(-1, 3):
                off = y - n if n > 0 else n - y
                if off > _TAIL * s:
                    total += 2 * off
                elif off > -_TAIL * s:
                    z = off / s
                    below = math.erfc(-z / math.sqrt(2.0)) / 2
                    total += 2 * (off * below + s * math.exp(-z * z / 2) / math.sqrt(2 * math.pi))
        else:
            total = 1 / 6
            for j in range(1, 6):
                damping = math.exp(-2 * (math.pi * j * s) ** 2)
                if damping < 1e-17:
                    break
                total -= math.cos(2 * math.pi * j * mean[pixel]) * damping / (math.pi * j) ** 2
        q[pixel] = total
    return q


def latched_third(mean: Values, variance: Values) -> Values:
    """What the latch adds to the third central moment of a sum of intervals, cycles^3, (n,).

    E[(N - M)^3] = E[(X - M)^3] + 3 E[(X - M) f (1 - f)] + E[f (1 - f) (1 - 2 f)], whose series are
    sum_j (6 V / (pi j) + 3 / (pi j)^3) sin(2 pi j M) exp(-2 pi^2 j^2 V): nothing on average over M.

    Args:
        mean, variance: M and V as in `latched_variance`.
    """
    total = np.zeros(np.shape(mean))
    for j in range(1, _TERMS + 1):
        damping = np.exp(-2 * (np.pi * j) ** 2 * variance)
        if not np.any(damping > 1e-9):
            break
        size = 6 * variance / (np.pi * j) + 3 / (np.pi * j) ** 3
        total += size * np.sin(2 * np.pi * j * mean) * damping
    return total


def sample_variance(
    mean: Values, variance: Values | float, k: int, blocks: int, timing: float = 0.0
) -> Values:
    """Expected sample variance of `blocks` sums of `k` intervals, equation (2), cycles^2.

    Args:
        mean: mean interval of each pixel, cycles, (n,).
        variance: variance of an interval, cycles^2, (n,) or a number.
        k: intervals in a sum.
        blocks: sums of a pixel, 2 or more.
        timing: variance that noise of the latch's instants gives each sum, cycles^2: a part of X
            that neighbouring sums share as they share the rounding.
    """
    own = k * np.asarray(variance)
    each = latched_variance(k * mean, own + timing) + timing
    total = latched_variance(k * blocks * mean, blocks * own + timing) + timing
    return np.asarray(k * variance + (blocks * each - total / blocks) / (blocks - 1))


def latched_probabilities(
    mean: Values, spread: float, skew: float, lost: float, longest: int
) -> Values:
    """Law of a latched interval of pixels: P(N = 1), ..., P(N = longest) and the rest, (n, longest
    + 1).

    X is `lost` plus light of the relative standard deviation `spread` and this skewness, as a
    shifted Gamma variate (Pearson's type III): exactly the law of shot noise if skew = 2 spread,
    and close to the normal law as skew tends to 0. With G(y) = E[(y - X)+], P(N = k) = G(k + 1) - 2
    G(k) + G(k - 1), because N = k where |X - k| < 1, with chance 1 - |X - k|. For a Gamma variate
    of shape a and scale b, G(y) = y F_a(y / b) - a b F_(a+1)(y / b).

    Args:
        mean: mean intervals, cycles, (n,), above `lost`.
        spread: spread of X less `lost`, relative, above 0.
        skew: skew of X, above 0; at most 2 `spread`.
        lost: dead time, cycles.
        longest: last interval with a probability of its own, cycles.
    """
    from scipy.special import gammainc

    light = (mean - lost)[:, None]
    shape = 4 / skew**2
    scale = light * spread * skew / 2
    y = np.maximum(np.arange(longest + 2)[None, :] - (mean[:, None] - shape * scale), 0.0)
    below = y * gammainc(shape, y / scale) - shape * scale * gammainc(shape + 1, y / scale)
    inner = below[:, 2:] - 2 * below[:, 1:-1] + below[:, :-2]
    inner[:, 0] += below[:, 0]  # N = 0 cannot be latched: two crossings show as one
    rest = np.maximum(1 - inner.sum(axis=1, keepdims=True), 0.0)
    return np.hstack([np.maximum(inner, 0.0), rest])


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
