"""Fixed pattern, dark current and dead time from flats and a dark recording, by likelihood.

A pixel with threshold Q (1 + f), gain of light 1 + p, and dark current D (1 + h), in thresholds a
cycle, fires under the light L at the rate r of

    x = r / (1 - r d) = (L (1 + p) + D (1 + h)) / (1 + f) = L (1 + gamma) + D (1 + delta)      (1)

with dead time d in cycles: an interval is 1/x + d (non-paralysable dead time). p, f and h are
independent over pixels, so

    var gamma = A = prnu^2 + fpn^2
    var delta = B = dsnu^2 + fpn^2                                                              (2)
    cov(gamma, delta) = C = fpn^2

Flats alone give A: PRNU and spread of the threshold are one number in light. In the dark, charge is
not scaled by the gain of light but by the threshold, so the covariance of gamma and delta, C, tells
them apart. The standard error of C is about sqrt((A B + C^2) / n) for n pixels: a small spread of
dark current helps. An offset of x is L or D: D needs a recording without light, or stated ratios
of the levels.

The dead time needs no light meter: by (1), x at two levels differs by a factor and by D (1 +
delta), the same factor for all pixels; rates of the brighter level have their spread compressed, by
1 - r d. The spread of the pattern is the light meter.

gamma and delta are taken as normal. The measured x of the levels are then jointly normal with
covariance A L L' + C D (L 1' + 1 L') + B D^2 plus the temporal noise of x, and the dark recording
adds the likelihood of censored.py for d given them. Limits come from the sandwich covariance H^-1
(sum of s s') H^-1 with the scores s of pixels and the curvature H, which holds even if the laws are
not quite normal (White, Econometrica 50:1, 1982).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.censored import dark_likelihood
from sensor.calibrate.trains import Trains

Values = npt.NDArray[np.float64]
MOST_PIXELS: Final = 65_536
"""Pixels of the likelihood at most, evenly spaced over larger chips."""
_STEP: Final = 1e-5
"""Step of differences, in the scale of each parameter."""
_TURNS: Final = 60
_NEAR: Final = 1e-5
"""Twice the rise of the logarithm that is left at the maximum: standard errors squared."""
_CLOSE: Final = 0.01
"""The same, from which the climb has failed."""
_IMPOSSIBLE: Final = 1e12


@dataclass(frozen=True, eq=False)
class PatternFit:
    """The fit.

    Attributes:
        light: L of each flat, spikes a cycle without dead time.
        dark: D; None if it is not identified.
        gain: A. dark_spread: B. common: C; None without D.
        dead: dead time, cycles; None with fewer than two levels.
        covariance: covariance of (light ..., dark, A, B, C, dead), nan where not identified.
        pixels: number of pixels.
        misfit: squared distance of the pixels' x from the model over its expectation, and the
            number of standard errors from 1.
        converged: whether the likelihood has its maximum there.
    """

    light: Values
    dark: float | None
    gain: float
    dark_spread: float | None
    common: float | None
    dead: float | None
    covariance: Values
    pixels: int
    misfit: tuple[float, float]
    converged: bool

    def error(self, *weights: float) -> float:
        """Standard error of a weighted sum of (D, A, B, C, dead)."""
        w = np.array(weights)
        tail = self.covariance[-5:, -5:][np.ix_(w != 0, w != 0)]
        return float(np.sqrt(w[w != 0] @ tail @ w[w != 0]))


class _Model:
    """The likelihood as a function of scaled parameters: (log light of each free level, log D, A /
    A0, B / B0, C / A0, dead / 0.01 cycle); see `fit_pattern` for the arguments."""

    def __init__(
        self, flats: Sequence[Trains], dark: Trains | None, ratios: Sequence[float | None],
        shade: Values, good: npt.NDArray[np.intp], squared: float, timing: float,
    ) -> None:  # fmt: skip
        self.intervals = np.stack([flat.intervals[good] for flat in flats])
        self.shade, self.squared, self.timing = shade[good], squared, timing
        number = np.array([flat.spikes[good].mean() - 1 for flat in flats])
        self.number = number
        self.dark = None
        if dark is not None:
            self.dark = dark.spikes[good], dark.first[good], dark.last[good], dark.cycles
        stated = [n for n, ratio in enumerate(ratios) if ratio is not None]
        self.has_dark = dark is not None or len(stated) > 1
        self.has_dead = len(flats) > 1
        self.level = np.zeros(len(flats), int)  # of each flat: its parameter
        self.offset = np.zeros(len(flats))
        free = 0
        for n, ratio in enumerate(ratios):
            if ratio is None or n == stated[0]:
                self.level[n], free = free, free + 1
            else:
                self.level[n] = self.level[stated[0]]
            if ratio is not None:
                self.offset[n] = np.log(ratio / ratios[stated[0]])  # type: ignore[operator]
        self.free = free
        x = 1 / self.intervals
        middle = x.mean(axis=1)
        start_dark, start_dead = 0.0, 0.0
        if self.dark is not None:
            start_dark = float(max(self.dark[0].mean(), 0.5 / len(good)) / self.dark[3])
        elif self.has_dark:
            known = [ratios[n] for n in stated]
            start_dark, start_dead = _from_means(np.array(known, float), middle[stated])
        relative = x[np.argmax(middle)] / middle.max() - 1 - self.shade
        self.gain = max(float(relative.var()), 1e-8)
        self.spread = self._dark_spread(start_dark)
        lights = np.zeros(free)
        for n in range(len(flats)):
            lit = middle[n] / (1 - start_dead * middle[n]) - start_dark
            lights[self.level[n]] = np.log(max(lit, 1e-9)) - self.offset[n]
        self.names = [*["light"] * free]
        start = [*lights]
        if self.has_dark:
            self.names += ["dark", "gain", "spread", "common"]
            start += [np.log(start_dark), 1.0, 1.0, 0.3]
        else:
            self.names += ["gain"]
            start += [1.0]
        if self.has_dead:
            self.names.append("dead")
            start.append(start_dead / 0.01)
        self.start = np.array(start)

    def _dark_spread(self, dark: float) -> float:
        """A first value of B."""
        if self.dark is None:
            return 0.01
        spikes, first, last, _ = self.dark
        many = spikes > 1
        if many.sum() < 100:
            return 0.05
        rate = (spikes[many] - 1) / (last[many] - first[many])
        return max(float(rate.var() / rate.mean() ** 2), 1e-5)

    def unpack(self, theta: Values) -> tuple[Values, float, float, float, float, float]:
        """(L, D, A, B, C, dead)."""
        given = dict(zip(self.names[self.free :], theta[self.free :], strict=True))
        light = np.exp(theta[self.level] + self.offset)
        dark = float(np.exp(given["dark"])) if self.has_dark else 0.0
        return (
            light, dark, self.gain * given["gain"], self.spread * given.get("spread", 0.0),
            self.gain * given.get("common", 0.0), 0.01 * given.get("dead", 0.0),
        )  # fmt: skip

    def deviations(self, theta: Values) -> tuple[Values, Values, Values]:
        """x of all levels less its mean, (levels, n); its covariance; and x."""
        light, dark, gain, spread, common, dead = self.unpack(theta)
        x = 1 / (self.intervals - dead)
        off = x - light[:, None] * (1 + self.shade) - dark
        typical = light + dark
        noise = self.squared * self.number / typical**2 + 1 / 6 + 2 * self.timing
        cross = common * dark * (light[:, None] + light[None, :])
        covariance = gain * np.outer(light, light) + cross + spread * dark**2
        covariance[np.diag_indices_from(covariance)] += noise * typical**4 / self.number**2
        return off, covariance, x

    def __call__(self, theta: Values) -> Values:
        """Logarithm of the likelihood of each pixel, (n,)."""
        light, dark, _, spread, common, dead = self.unpack(theta)
        off, covariance, x = self.deviations(theta)
        try:
            factor = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            return np.full(x.shape[1], -_IMPOSSIBLE)
        if np.any(x <= 0):
            return np.full(x.shape[1], -_IMPOSSIBLE)
        z = np.linalg.solve(factor, off)
        out = -0.5 * (z**2).sum(axis=0) - np.log(np.diag(factor)).sum()
        out += 2 * np.log(x).sum(axis=0)  # from x to the measured interval
        if self.dark is None:
            return np.asarray(out)
        shared = dark * (common * light + spread * dark)
        pull = np.linalg.solve(covariance, shared)
        variance = spread * dark**2 - float(pull @ shared)
        if variance <= 0:
            return np.full(x.shape[1], -_IMPOSSIBLE)
        spikes, first, last, cycles = self.dark
        mean = dark + pull @ off
        return np.asarray(out + dark_likelihood(
            spikes, first, last, cycles, mean, np.full(mean.shape, variance), self.squared, dead
        ))  # fmt: skip

    def scores(self, theta: Values) -> Values:
        """Derivatives of the logarithms, (n, parameters)."""
        steps = _STEP * np.eye(len(theta))
        return np.stack([(self(theta + s) - self(theta - s)) / (2 * _STEP) for s in steps], 1)

    def curvature(self, theta: Values) -> Values:
        """Second derivatives of minus the sum of the logarithms."""
        steps = _STEP * np.eye(len(theta))
        rises = [self.scores(theta + s).sum(axis=0) - self.scores(theta - s).sum(axis=0)
                 for s in steps]  # fmt: skip
        out = -np.array(rises) / (2 * _STEP)
        return np.asarray((out + out.T) / 2)


def _from_means(ratios: Values, rates: Values) -> tuple[float, float]:
    """First values of D and dead time from the mean rates under light of stated ratios:
    1/rate = 1/(c ratio + D) + dead, by relative least squares; two levels are taken as without
    dead time."""
    from scipy.optimize import least_squares

    line = np.stack([ratios, np.ones_like(ratios)], axis=1) / rates[:, None]
    (slope, dark), *_ = np.linalg.lstsq(line, np.ones_like(rates), rcond=None)
    floor = 1e-3 * float(rates.min())
    if len(ratios) < 3:
        return max(float(dark), floor), 0.0

    def off(theta: Values) -> Values:
        light, least = np.exp(theta[:2])
        return np.asarray(rates * (1 / (light * ratios + least) + theta[2]) - 1)

    begin = [np.log(slope), np.log(max(dark, floor)), 0.0]
    found = least_squares(off, begin, xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    return max(float(np.exp(found[1])), floor), float(found[2])


def _climb(model: _Model) -> Values:
    """The maximum of the likelihood. A step solves with the scores' products, which always climbs
    (Berndt, Hall, Hall and Hausman, Ann. Econ. Soc. Meas. 3:653, 1974), and near the maximum with
    the curvature."""
    theta, height = model.start, float(model(model.start).sum())
    for turn in range(_TURNS):
        scores = model.scores(theta)
        slope = scores.sum(axis=0)
        matrix = scores.T @ scores
        if turn > 5:
            curvature = model.curvature(theta)
            if np.linalg.eigvalsh(curvature)[0] > 0:
                matrix = curvature
        step = np.linalg.lstsq(matrix, slope, rcond=1e-14)[0]
        if float(step @ slope) < _NEAR:
            break
        for _ in range(30):
            there = float(model(theta + step).sum())
            if there > height:
                break
            step = step / 2
        else:
            break
        theta, height = theta + step, there
    return theta


def fit_pattern(
    flats: Sequence[Trains], dark: Trains | None, ratios: Sequence[float | None],
    shade: Values, good: npt.NDArray[np.bool_], squared: float, timing: float,
) -> PatternFit:  # fmt: skip
    """Fits the model to flats of unknown constant light and a dark recording.

    Args:
        flats: recordings of uniform light, one or more.
        dark: recording without light; None for none.
        ratios: light of each flat in any common unit; None if it is not known.
        shade: (n,) relative deviation of the light on each pixel.
        good: (n,) bool, pixels without defects that fired twice in every flat.
        squared: relative variance of an interval.
        timing: variance of the latch's instants, cycles^2.
    """
    chosen = np.flatnonzero(good)
    chosen = chosen[:: -(-len(chosen) // MOST_PIXELS)]
    model = _Model(flats, dark, ratios, shade, chosen, squared, timing)
    n = len(chosen)
    theta = _climb(model)
    scores = model.scores(theta)
    curvature = model.curvature(theta)
    inverse = np.linalg.pinv(curvature, hermitian=True)
    slope = scores.sum(axis=0)
    left = abs(float(slope @ inverse @ slope))
    spread = inverse @ (scores.T @ scores) @ inverse
    light, dark_rate, gain, dark_spread, common, dead = model.unpack(theta)
    places = {name: i for i, name in enumerate(model.names) if name != "light"}
    scale = {
        "dark": dark_rate, "gain": model.gain, "spread": model.spread, "common": model.gain,
        "dead": 0.01,
    }  # fmt: skip
    total = len(flats) + 5
    turn = np.zeros((total, len(theta)))
    for level in range(len(flats)):
        turn[level, model.level[level]] = light[level]
    for row, name in enumerate(scale, len(flats)):
        if name in places:
            turn[row, places[name]] = scale[name]
    covariance = turn @ spread @ turn.T
    unknown = [row for row, name in enumerate(scale, len(flats)) if name not in places]
    covariance[unknown], covariance[:, unknown] = np.nan, np.nan
    off, expected, _ = model.deviations(theta)
    distance = (off * np.linalg.solve(expected, off)).sum(axis=0) / len(flats)
    error = float(distance.std() / np.sqrt(n))
    return PatternFit(
        light, dark_rate if model.has_dark else None, gain,
        dark_spread if model.has_dark else None, common if model.has_dark else None,
        dead if model.has_dead else None, covariance, n,
        (float(distance.mean()), (float(distance.mean()) - 1) / error), left < _CLOSE,
    )  # fmt: skip
