"""Temporal noise of an interval, timing noise of the latch, and what skewness tells of electrons.

Let m be the mean interval of a pixel, d the dead time, and sigma the relative standard deviation of
the charge of an interval: sigma^2 = 1/Q + (threshold noise / Q)^2, the shot noise of Q electrons
and the noise of the threshold. Both belong to a spike, not to a time, so an interval has the
standard deviation sigma (m - d) under any light: light levels do not tell the two apart. The sample
variance of sums of k intervals, less what the latch adds (equation 2 of histograms.py), is k
sigma^2 (m - d)^2 + 2 s^2, with s the timing noise of the latch, which does not accumulate. Two
values of k give both.

What does tell them apart is the third central moment: a Gamma(Q) variate has 2/Q^2 of its mean
cubed, a normal one 0, and the latch adds none on average over the phase. So

    1/Q^2 = third / (2 k (m - d)^3).                                                            (1)

Its standard error grows as sigma^3, so it needs a small Q or very many spikes; 1/Q <= sigma^2 holds
always. Pixels are independent, so every interval follows from the spread over pixels (sandwich
estimate; White, Econometrica 50:1, 1982).

All this takes the phases of sums as uniform. Noise that adds up over the recording makes them so,
and so do pixels whose mean intervals differ. Pixels that are alike and nearly free of noise round
alike in each sum: their rounding then looks like noise, or hides it, and neither can be known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.histograms import latched_third, sample_variance
from sensor.calibrate.trains import SIGNIFICANT, Trains
from sensor.latched.effects.drift import KNOT

Values = npt.NDArray[np.float64]
_SPARE: Final = 0.02
"""Share of pixels, those with fewest spikes, whose intervals are not used: with the same number of
sums for all others, that number does not depend on their noise."""
_ROUNDS: Final = 12
"""Rounds of the fixed point of sigma at most; its share in the latch's variance is small."""
_SETTLED: Final = 1e-9
"""Change of a fixed point over its value at which it is reached."""
_NONE: Final = 1e-15
"""Square, or variance in cycles^2, below which one is none, and a change of it as well."""
_DRIFTING: Final = 64
"""Cycles of the longest sum of intervals where the gain of all pixels drifts: those of the sums of
counts that show the drift."""
_STRAYED: Final = 0.5
"""Variance of a pixel's last spike by its noise, cycles^2, from which its phase is its own: the
first term of the latch's series is below exp(-pi^2)."""
_APART: Final = 10.0
"""Cycles by which the last spikes of pixels are apart, RMS, from which they have all phases, also
in sums of a third of the recording."""
_SATURATED: Final = 5.0
"""Standard deviations of an interval by which it must be longer than a cycle: a shorter one may
hide a spike."""


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error."""

    value: float
    error: float


@dataclass(frozen=True, eq=False)
class Level:
    """Noise of one recording.

    Attributes:
        name: name of the recording.
        rate: spikes a cycle.
        k: intervals in a sum.
        squared: sigma^2.
        slope: its derivative with respect to the dead time, 1/cycle.
        jitter: s^2, cycles^2; negative values are noise.
        third: 1/Q^2 by equation (1); None where sums are too few.
        mixed: whether its sums have all phases.
        most: sigma^2 from which they have by noise alone.
    """

    name: str
    rate: float
    k: int
    squared: Estimate
    slope: float
    jitter: Estimate
    third: Estimate | None
    mixed: bool
    most: float


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of a camera.

    Attributes:
        levels: levels of the recordings; those whose sums have all phases, if there are any.
        squared: sigma^2, from all of them.
        slope: its derivative with respect to the dead time, 1/cycle.
        jitter: s^2, cycles^2.
        third: 1/Q^2; None if no recording tells.
        timing: whether the timing noise of the latch is significant, and taken off.
        mixed: whether sums have all phases; without, the values are no estimates.
        most: sigma^2 that could be overlooked without.
    """

    levels: tuple[Level, ...]
    squared: Estimate
    slope: float
    jitter: Estimate
    third: Estimate | None
    timing: bool
    mixed: bool
    most: float


def _weighted(parts: Sequence[Estimate]) -> tuple[Estimate, Values]:
    """Mean of independent estimates, weighted by their inverse variances, and the weights."""
    weights = np.array([1 / max(p.error, 1e-30) ** 2 for p in parts])
    weights /= weights.sum()
    value = float(weights @ [p.value for p in parts])
    return Estimate(value, float(np.sqrt(weights**2 @ [p.error**2 for p in parts]))), weights


def drift_covariance(cycles: int, sums: int) -> Values:
    """Covariance of the mean gains of successive sums of a number of cycles, (sums, sums), for a
    drift of 1: normal values KNOT cycles apart, linear in between."""
    at = (np.arange(sums * cycles) + 0.5) / KNOT
    knots, whole = np.zeros((sums, int(at[-1]) + 2)), at.astype(int)
    block = np.arange(sums * cycles) // cycles
    np.add.at(knots, (block, whole), (1 - at % 1) / cycles)
    np.add.at(knots, (block, whole + 1), (at % 1) / cycles)
    return np.asarray(knots @ knots.T)


def drift_variance(cycles: int, sums: int) -> float:
    """Expected sample variance of these mean gains."""
    covariance = drift_covariance(cycles, sums)
    return float((np.trace(covariance) - covariance.sum() / sums) / max(sums - 1, 1))


def measure_noise(
    recordings: Sequence[tuple[Trains, npt.NDArray[np.bool_]]], dead: float, drift: float = 0.0
) -> Noise | None:
    """Noise from recordings of constant light with their good pixels, (n,) bool each.

    Args:
        recordings: recordings of one camera.
        dead: dead time, cycles.
        drift: RMS of the gain that all pixels have in common, whose part in long sums is taken off.

    Returns:
        None if no recording has pixels with enough intervals.
    """
    found = [level for level in (_level(*each, dead, False, drift) for each in recordings) if level]
    if not found:
        return None
    mixed = any(level.mixed for level in found)
    used = {level.name for level in found if level.mixed == mixed}
    found = [level for level in found if level.name in used]
    jitter, _ = _weighted([level.jitter for level in found])
    timing = mixed and jitter.value > SIGNIFICANT * jitter.error
    if timing:
        again = (_level(*each, dead, True, drift) for each in recordings if each[0].name in used)
        found = [level for level in again if level]
        jitter, _ = _weighted([level.jitter for level in found])
    squared, weights = _weighted([level.squared for level in found])
    thirds = [level.third for level in found if level.third is not None]
    return Noise(
        tuple(found), squared, float(weights @ [level.slope for level in found]), jitter,
        _weighted(thirds)[0] if thirds else None, timing, mixed,
        min(level.most for level in found),
    )  # fmt: skip


def _level(
    trains: Trains, good: npt.NDArray[np.bool_], dead: float, timing: bool, drift: float
) -> Level | None:
    """Noise of one recording; None if its intervals are too few or too short."""
    known = trains.spikes[good & (trains.spikes > 0)]
    if not known.size:
        return None
    fewest = int(np.quantile(known, _SPARE)) - 1
    if fewest < 8:
        return None
    mean = trains.intervals
    typical = float(np.median(mean[good & (trains.spikes > 1)]))
    if typical - dead <= 0:
        return None
    one = _Sum(trains, good, 1, fewest, dead, drift)
    if not one.pixels.any():
        return None
    squared, k = one.solve(0.0).value, 1
    if typical <= 1 + _SATURATED * math.sqrt(max(squared, 0)) * typical:
        return None
    long, added = one, Estimate(0.0, 0.0)
    if timing:
        squared = 0.0  # the first sums are as long as may be: single ones show timing noise alone
    for _ in range(4):  # a longer sum shows the noise better, which then says how long it must be
        variance = max(squared, 1e-12) * (typical - dead) ** 2
        wanted = math.ceil((1 / 6 + 2 * added.value) / variance)
        most = max(fewest // 3, 1)
        if drift:  # whose part in a sum grows with its square
            most = min(most, max(round(_DRIFTING / typical), 3))
        k = int(np.clip(wanted, 3 if timing else 1, most))
        long = _Sum(trains, good, k, fewest, dead, drift)
        if timing:
            estimate, added = _with_timing(one, long)
        else:
            estimate = long.solve(0.0)
        if _settled(max(squared, 0.0), max(estimate.value, 0.0)):
            break
        squared = estimate.value
    jitter = added
    if not timing:
        apart = _Sum(trains, good, max(k, 3), fewest, dead, drift)
        whole = apart.solve(0.0)
        # Timing noise is in both sums alike: one.excess = squared + 2 s^2 / m^2, and 1/k in k.
        short = one.solve(0.0, whole.value)
        scale = float((one.light[one.pixels] ** 2).mean()) / 2 / (1 - 1 / apart.k)
        error = _difference(one, apart, short, whole) * scale
        jitter = Estimate((short.value - whole.value) * scale, error)
    shifted = _Sum(trains, good, long.k, fewest, dead + 0.01, drift).solve(2 * added.value).value
    slope = (shifted - long.solve(2 * added.value).value) / 0.01
    own = _STRAYED / (fewest * (typical - dead) ** 2)
    low, high = np.quantile(mean[one.pixels], (0.16, 0.84))
    mixed = bool(
        estimate.value + 2 * estimate.error > own
        or trains.cycles * (high - low) / 2 > _APART * typical
    )
    return Level(
        trains.name, trains.rate, long.k, estimate, slope, jitter, long.third(squared), mixed, own
    )


class _Sum:
    """Sums of k intervals of the good pixels of a recording.

    Attributes:
        pixels: (n,) bool, pixels with enough spikes.
        light: (n,) mean interval less dead time, cycles.
        k: intervals in a sum.
    """

    def __init__(
        self, trains: Trains, good: npt.NDArray[np.bool_], k: int, fewest: int, dead: float,
        drift: float,
    ) -> None:  # fmt: skip
        self._sums = trains.sums(k, max(fewest // k, 2), good)
        self.pixels, self.k = self._sums.used, k
        self._mean = trains.intervals
        self.light = self._mean - dead
        self._drifted: Values | float = 0.0
        if drift and self.pixels.any():
            sums = k * self._mean[self.pixels]
            share = drift_variance(max(round(float(np.median(sums))), 1), self.blocks)
            self._drifted = drift**2 * share * sums**2

    def solve(self, timing: float, start: float | None = None) -> Estimate:
        """sigma^2 if the latch's instants give each sum the variance `timing` = 2 s^2, cycles^2;
        with `start`, the share of sigma in the latch's variance is that of this value."""
        used = self.pixels
        mean, light = self._mean[used], self.light[used]
        weight, squared = self.k * light**2, max(start or 0.0, 0.0)
        for _ in range(_ROUNDS if start is None else 1):
            variance = max(squared, 0.0) * light**2
            expected = sample_variance(mean, variance, self.k, self.blocks, timing)
            rest = self._sums.variance[used] - self._drifted - expected + self.k * variance
            last, squared = squared, float(rest.sum() / weight.sum())
            if _settled(max(last, 0.0), max(squared, 0.0)):
                break
        self.residual = rest - squared * weight
        self.weight = float(weight.sum())
        return Estimate(squared, math.sqrt(float((self.residual**2).sum())) / self.weight)

    @property
    def blocks(self) -> int:
        """Sums of a pixel."""
        return self._sums.blocks

    @property
    def shares(self) -> float:
        """Sum over pixels of what timing noise of variance 1 adds to the sample variance."""
        return float(self.pixels.sum()) * (self.blocks + 1) / self.blocks

    def third(self, squared: float) -> Estimate | None:
        """1/Q^2 by equation (1). squared: sigma^2, for the part of the latch."""
        if self._sums.blocks < 3:
            return None
        variance = self.k * max(squared, 0.0) * self.light[self.pixels] ** 2
        latch = latched_third(self.k * self._mean[self.pixels], variance)
        third = self._sums.third[self.pixels] - latch
        weight = 2 * self.k * self.light[self.pixels] ** 3
        value = float(third.sum() / weight.sum())
        off = third - value * weight
        return Estimate(value, math.sqrt(float((off**2).sum())) / float(weight.sum()))


def _settled(before: float, now: float) -> bool:
    """Whether a fixed point is reached, from two of its values, 0 or more."""
    return abs(now - before) <= _SETTLED * now + _NONE


def _difference(one: _Sum, other: _Sum, short: Estimate, long: Estimate) -> float:
    """Standard error of the difference of two estimates from the same pixels."""
    if one.pixels.sum() != other.pixels.sum():
        return math.hypot(short.error, long.error)
    off = one.residual / one.weight - other.residual / other.weight
    return math.sqrt(float((off**2).sum()))


def _with_timing(one: _Sum, long: _Sum) -> tuple[Estimate, Estimate]:
    """sigma^2 and s^2 from sums of 1 and of k intervals, in turn: sigma^2 from the long ones, in
    which timing noise counts 1/k, and 2 s^2 from the single ones."""
    timing = squared = 0.0
    for _ in range(4 * _ROUNDS):
        before = squared, timing
        squared = long.solve(timing, squared).value
        short = one.solve(timing, squared)
        timing = max(timing + (short.value - squared) * one.weight / one.shares, 0.0)
        if _settled(max(before[0], 0.0), max(squared, 0.0)) and _settled(before[1], timing):
            break
    squared = long.solve(timing).value
    one.solve(timing, squared)
    matrix = np.array([[one.weight, one.shares], [long.weight, long.shares]])
    both = np.zeros((2, one.pixels.size))
    both[0, one.pixels], both[1, long.pixels] = one.residual, long.residual
    error = np.sqrt((np.linalg.solve(matrix, both) ** 2).sum(axis=1))
    return Estimate(squared, float(error[0])), Estimate(timing / 2, float(error[1]) / 2)
