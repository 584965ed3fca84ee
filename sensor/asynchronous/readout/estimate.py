"""The light on a set of pixels from their first widths: maximum likelihood with censoring.

Each pixel of a target is one observation of the same rate: a width in ticks (Gamma law of the
threshold between two instants; from zero where the shortest width held the pixel back), a reading
below threshold (Poisson law between two numbers of electrons), or silence (fewer than Q electrons
by the end: P(N < Q)). All pixels count, so that a target of which few pixels fire is not estimated
from these alone.

A likelihood that is cut off has no peak, so the Gamma law's tails are computed as logarithms,
however far out. scipy's tails underflow 37 standard deviations away, and the first look at a
likelihood lies thousands away. There the continued fractions converge within some tens of terms:
8.9.2 of the NIST Digital Library of Mathematical Functions above, 8.9.1 below.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.plan.error import DEVIATIONS
from sensor.asynchronous.model import EventModel

Reals = npt.NDArray[np.float64]
Rates = npt.NDArray[np.float64]
_DEEP = 1e-250
"""Tail below which the continued fraction takes over."""
_TERMS = 1000
_EPS = 1e-14
Term = Callable[[int], tuple[Reals | float, Reals | float]]
_NARROW = 1e-3
"""Tick over standard deviation of a width below which a tick's probability is density x tick; that
is off by its square over 24."""
_GRID = 161


@dataclass(frozen=True, eq=False)
class Observed:
    """The first report of each pixel.

    Attributes:
        widths: ticks of the pixels that fired first, counted from the edge of a tick.
        levels: levels of the pixels that were read first.
        silent: number of pixels without a report.
        waited: time without a report of these, ps.
    """

    widths: npt.NDArray[np.int64]
    levels: npt.NDArray[np.int64]
    silent: int
    waited: int

    def __len__(self) -> int:
        return len(self.widths) + len(self.levels) + self.silent


@dataclass(frozen=True)
class RateEstimate:
    """An estimate with its confidence interval.

    Attributes:
        rate: electrons/s; 0 without any charge, infinite if every width was held back.
        low, high: limits of 99.9 % from the curvature of the likelihood. Where the rate is 0 or
            infinite, the other limit is where the likelihood has fallen as far.
    """

    rate: float
    low: float
    high: float


def estimate_rate(model: EventModel, observed: Observed) -> RateEstimate:
    """The rate under which what was seen is most likely. Raises ValueError without pixels.

    The pixels are taken to be identical: that their gains differ (PRNU) is in the estimate's error,
    by PRNU over the square root of their number, but not in low and high.
    """
    from scipy.optimize import minimize_scalar

    if not len(observed):
        raise ValueError("an estimate needs at least one pixel")
    longest = max(observed.waited, model.longest, model.tick * int(observed.widths.max(initial=1)))
    least = 1e-6 * PS / (longest * len(observed))
    most = 1e3 * (model.threshold + 10) * PS / min(model.tick, longest)
    grid = np.linspace(math.log(least), math.log(most), _GRID)
    # The highest point, then twice a finer look around it: however narrow the peak, it is the only
    # one and no flank is flat.
    for _ in range(3):
        height = log_likelihood(model, observed, np.exp(grid))
        best = int(np.argmax(height))
        left, right = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
        grid = np.linspace(left, right, _GRID)

    def loss(x: float) -> float:
        return -float(log_likelihood(model, observed, np.exp(np.array([x])))[0])

    found = minimize_scalar(loss, bounds=(left, right), method="bounded", options={"xatol": 1e-10})
    peak, rate = -float(found.fun), math.exp(float(found.x))
    small, large = math.log(least), math.log(most)
    flat = 1e-9 * max(abs(peak), 1.0)
    if -loss(small) >= peak - flat:
        return RateEstimate(0.0, 0.0, math.exp(_fallen(loss, small, large)))
    if -loss(large) >= peak - flat:
        return RateEstimate(math.inf, math.exp(_fallen(loss, large, small)), math.inf)
    step = 1e-3
    for _ in range(3):  # a step of one standard deviation measures the curvature best
        drop = 2 * peak + loss(float(found.x) - step) + loss(float(found.x) + step)
        step = min(step / math.sqrt(drop), 1.0) if drop > 0 else 1.0
    spread = math.exp(DEVIATIONS * step)
    return RateEstimate(rate, rate / spread, rate * spread)


def log_likelihood(model: EventModel, observed: Observed, rate: Rates) -> Rates:
    """Log likelihood of rates > 0, electrons a second, up to a constant; finite and, in log rate,
    concave: a threshold's logarithm has a concave log density, and counts cut to an interval vary
    less than Poisson's."""
    q, tick = float(model.threshold), model.tick
    total = np.zeros(rate.shape)
    ticks, times = np.unique(observed.widths, return_counts=True)
    high = ticks * float(tick) - model.delay
    held = (ticks - 1) * tick < model.shortest
    narrow = ~held & (tick * math.sqrt(q) < _NARROW * high)
    if narrow.any():
        tau, n = (high[narrow] - tick / 2) / PS, times[narrow]
        # Gamma's density at many widths: three sums say it all.
        total += n.sum() * q * np.log(rate) - rate * float((n * tau).sum())
    if not narrow.all():
        top = high[~narrow] / PS
        low = np.where(held, 0.0, np.maximum(high - tick, 0))[~narrow] / PS
        total += log_between(q, rate[:, None] * low, rate[:, None] * top) @ times[~narrow]
    if observed.silent:
        total += observed.silent * log_upper(q, rate * (max(observed.waited - model.delay, 0) / PS))
    levels, times = np.unique(observed.levels, return_counts=True)
    mean = rate * (model.longest / PS)
    for level, n in zip(levels.tolist(), times.tolist(), strict=True):
        least, most = model.electrons(level)
        if most < least:
            raise ValueError(f"no whole number of electrons reads as level {level}")
        total += n * log_counts(mean, least, most)
    return total


def _fallen(loss: Callable[[float], float], top: float, away: float) -> float:
    """Where, from `top` towards `away`, the log-likelihood has fallen by half of DEVIATIONS^2."""
    from scipy.optimize import brentq

    level = loss(top) + DEVIATIONS**2 / 2
    return float(brentq(lambda x: loss(x) - level, top, away, xtol=1e-6))


def single_rates(model: EventModel, observed: Observed) -> npt.NDArray[np.float64]:
    """The light of every pixel by its own report alone, electrons a second: Q/width of those that
    fired, then (level Q/N)/longest of those read."""
    q = float(model.threshold)
    fired = q * PS / np.maximum(observed.widths * float(model.tick) - model.delay, 1.0)
    read = observed.levels * q * PS / model.levels / max(model.longest, 1)
    return np.concatenate([fired, read])


def mean_rate(model: EventModel, observed: Observed) -> float:
    """The plain way beside it: the mean of the pixels' own rates; NaN without any report."""
    rates = single_rates(model, observed)
    return float(rates.mean()) if rates.size else math.nan


def log_counts(mean: Reals, least: int, most: int) -> Reals:
    """log P(least <= Poisson(mean) <= most), mean > 0."""
    if least == 0:
        return log_upper(most + 1.0, mean)
    result = np.empty(mean.shape)
    up = mean < least
    result[up] = _less(log_lower(float(least), mean[up]), log_lower(most + 1.0, mean[up]))
    down = ~up
    result[down] = _less(log_upper(most + 1.0, mean[down]), log_upper(float(least), mean[down]))
    return result


def log_between(q: float, a: Reals, b: Reals) -> Reals:
    """log P(a < Gamma(q) <= b), 0 <= a < b: the difference of the smaller tails."""
    result = np.empty(a.shape)
    up = a > q
    result[up] = _less(log_upper(q, a[up]), log_upper(q, b[up]))
    down = ~up
    result[down] = _less(log_lower(q, b[down]), log_lower(q, a[down]))
    return result


def log_upper(q: float, x: Reals) -> Reals:
    """log P(Gamma(q) > x) = log P(Poisson(x) < q), x >= 0 finite, any shape."""
    from scipy.special import gammaincc

    return _log_tail(q, x, gammaincc(q, x), _far_upper)


def log_lower(q: float, x: Reals) -> Reals:
    """log P(Gamma(q) <= x) = log P(Poisson(x) >= q); minus infinity at 0."""
    from scipy.special import gammainc

    return _log_tail(q, x, gammainc(q, x), _far_lower)


def _fraction(first: Reals, term: Term) -> Reals:
    """first + a1/(b1 + a2/(b2 + ...)), term(i) = (a_i, b_i); modified Lentz."""
    value = first.copy()
    c, d = first.copy(), np.zeros(first.shape)
    for i in range(1, _TERMS):
        a, b = term(i)
        d = 1.0 / (b + a * d)
        c = b + a / c
        step = c * d
        value *= step
        if (np.abs(step - 1.0) < _EPS).all():
            break
    return value


def _far_upper(q: float, x: Reals) -> Reals:
    whole = _fraction(x + 1.0 - q, lambda i: (i * (q - i), x + (2 * i + 1) - q))
    return q * np.log(x) - x - math.lgamma(q) - np.log(whole)


def _far_lower(q: float, x: Reals) -> Reals:
    def term(i: int) -> tuple[Reals, float]:
        return (-(q + i // 2) * x if i % 2 else (i // 2) * x), q + i

    # The fraction of 8.9.1 times q.
    whole = _fraction(np.full(x.shape, q), term)
    return q * np.log(x) - x - math.lgamma(q) - np.log(whole)


def _log_tail(q: float, x: Reals, near: Reals, far: Callable[[float, Reals], Reals]) -> Reals:
    deep = (near < _DEEP) & (x > 0)
    result = np.full(x.shape, -np.inf)
    np.log(near, out=result, where=~deep & (near > 0))
    if deep.any():
        result[deep] = far(q, x[deep])
    return result


def _less(large: Reals, small: Reals) -> Reals:
    """log(exp(large) - exp(small)). Equal to the last digit counts as that digit."""
    return large + np.log(np.maximum(-np.expm1(np.minimum(small - large, 0.0)), 1e-16))
