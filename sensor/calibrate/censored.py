"""Likelihood of spikes in the dark, where an interval may be longer than the recording.

A pixel with d spikes a cycle fires at intervals of nearly 1/d; the recording of T cycles begins at
a random phase (renewal process in its stationary state; Cox, Renewal Theory, 1962, ch. 5), so

    no spike         max(0, 1 - T d)
    one, at t        d where 1/d > max(t, T - t), else 0
    n at t_1 .. t_n  d S(t_1) f(intervals) S(T - t_n), with S(t) the chance that an interval is
                     longer than t, and f the density of the complete intervals

Spikes over cycles alone would round 2.5 to 2 or 3; a complete interval tells d to a few per cent,
but pixels without one are the dark ones, so leaving them out would bias d. Here d itself is normal
over pixels (a negative one is a pixel without dark current), so each line is a normal integral:
E[(1 - T d)+] less E[(-T d)+], and E[d; 0 < d < c]. For n >= 2, f is a normal law about the measured
rate, and the other factors are taken at the mean of d given the intervals (Laplace).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Counts = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]
_LEAST: Final = 1e-12
"""Least likelihood of a pixel, so that one that does not fit the law does not rule the sum."""


def dark_likelihood(
    spikes: Counts, first: Counts, last: Counts, cycles: int,
    mean: Values, variance: Values, squared: float, dead: float,
) -> Values:  # fmt: skip
    """Logarithm of the likelihood of each pixel's spikes in the dark, (n,), but for a constant.

    Args:
        spikes: number of spikes.
        first, last: instants of the first and last spike, cycles.
        cycles: number of cycles of the recording.
        mean, variance: mean and variance of d before the dark recording is read, spikes a cycle,
            (n,).
        squared: relative variance of an interval.
        dead: dead time, cycles.
    """
    from scipy.special import log_ndtr, ndtr

    def density(z: Values) -> Values:
        return np.asarray(np.exp(-z * z / 2) / np.sqrt(2 * np.pi))

    def above(mean: Values, spread: Values) -> Values:
        """E[W+] of a normal W."""
        return np.asarray(mean * ndtr(mean / spread) + spread * density(mean / spread))

    out = np.empty(len(mean))
    blurred = np.sqrt(variance + squared * mean**2)  # noise of an interval blurs the edges
    none = spikes == 0
    spread = cycles * blurred[none]
    middle = cycles * mean[none]
    out[none] = np.log(np.maximum(above(1 - middle, spread) - above(-middle, spread), _LEAST))
    one = spikes == 1
    longest = np.maximum(first[one] + 0.5, cycles - first[one] - 0.5)
    low = -mean[one] / blurred[one]
    high = (1 / longest - mean[one]) / blurred[one]
    part = mean[one] * (ndtr(high) - ndtr(low)) - blurred[one] * (density(high) - density(low))
    out[one] = np.log(np.maximum(part, _LEAST))
    many = spikes > 1
    n, expected = spikes[many] - 1, np.maximum(mean[many], 0.5 / cycles)
    rate = 1 / ((last[many] - first[many]) / n - dead)
    error = (squared * rate**2 * n + rate**4 / 6) / n**2
    total = variance[many] + error
    off = rate * (1 + squared / n) - mean[many]
    given = np.maximum(mean[many] + variance[many] / total * off, 0.1 * expected)
    sigma = np.sqrt(squared) + 1e-3
    out[many] = (
        -0.5 * (np.log(total) + off**2 / total) + 2 * np.log(rate) + np.log(given)
        + log_ndtr((1 - first[many] * given) / sigma)
        + log_ndtr((1 - (cycles - last[many]) * given) / sigma)
    )  # fmt: skip
    return out
