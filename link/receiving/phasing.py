"""Time and brightness of symbols, to hundredths of a tick, from known symbols.

The likelihood of the spikes of modelled pixels (`synthesis`) is maximised by Fisher scoring with
Levenberg-Marquardt damping (Osborne, Int. Stat. Rev. 60:99, 1992; Marquardt, SIAM J. Appl. Math.
11:431, 1963). One pass over the bits gives the likelihood, its slope and its information, so five
to thirty passes reach the maximum to a fifth of its standard errors. A Nelder-Mead simplex took 300
to 600 passes for five parameters; stopped after 130, it ended far from the maximum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.receiving.kernels import slopes
from link.receiving.pacing import Delay
from link.receiving.recording import Recording
from link.receiving.synthesis import (
    FLOOR,
    NOISE,
    RULES,
    SKIP,
    Levels,
    Witnesses,
    choose_witnesses,
    known_cells,
    likelihood,
    likelihoods,
)
from link.timing import Registration, Timing

Floats = npt.NDArray[np.float64]
_PHASES: Final = (-1.0, 1.0, 0.125)
_ONS: Final = (0.6, 1.0, 1.4, 2.0, 3.0)
_BACKGROUNDS: Final = (0.02, 0.1, 0.25)
_FEW: Final = 200
"""Pixels of the first search."""
_MIDDLE: Final = 0.5
"""Position within the rows that the delay refers to."""
_SLOPE_ERROR, _PERIOD_ERROR = 0.1, 0.1
"""Standard errors of the slope by the pilots, ticks over the rows, and of their period, ticks over
the time in which they were observed."""
_BOX: Final = np.array([[-1.5, 0.1, 0.0, -0.5, -3.0], [1.5, 10.0, 1.0, 0.5, 3.0]])
"""Limits of delay, light, background, slope, and stretch (in errors of the pilots' period)."""
_STRIDE: Final = np.array([0.2, 0.4, 0.1, 0.1, 1.0])
"""Largest step of the same parameters."""
_TOP: Final = 0.02
"""Gain of a further step, nats, below which a climb ends; one standard error is half a nat."""
_STEPS: Final = 40
_DAMPING: Final = (1e-3, 0.2, 5.0, 1e7)
"""Marquardt's damping: initial value, factors after a step up and after a failed one, limit."""
_REACH, _TRIED = 0.5, 17
"""_REACH: ticks on each side in which the mean phase is searched. _TRIED: phases tried at a
time."""
_HOLD: Final = 3.0
"""Nats below the most likely phase within which the current phase is held."""
_MEASURED: Final = 24
"""Symbols of a measurement of the timing as it is followed."""
_SHARP, _FAR = 0.05, 0.45
"""_SHARP: largest error of a delay at a single maximum, ticks. _FAR: largest plausible delay,
ticks."""
_LIKELY: Final = 10.0
"""Nats below the most likely phase within which others count."""


@dataclass(frozen=True)
class Fit:
    """A fitted timing.

    Attributes:
        timing: timing of the symbols.
        levels: light of the cells.
        delay: change of the symbols' delay in the middle by the fit, ticks.
        drift: standard error of the period by chance, ticks a tick.
        passes: passes over the spikes of all pixels.
    """

    timing: Timing
    levels: Levels
    delay: float
    drift: float
    passes: int


@dataclass(frozen=True, eq=False)
class _Top:
    """A maximum of the likelihood.

    Attributes:
        at: (5,) delay, on, background, slope, stretch.
        nats: ln P minus the penalty of the prior.
        information: (5, 5), prior included.
        passes: passes over the spikes.
    """

    at: Floats
    nats: float
    information: Floats
    passes: int


def _moved(timing: Timing, w: Witnesses, delay: float, slope: float, stretch: float) -> Timing:
    """A timing delayed in the middle of the witnesses.

    Args:
        timing: initial timing.
        w: the witnesses.
        delay: delay in the middle, ticks.
        slope: additional delay over all rows, ticks.
        stretch: additional delay over the witnesses' time, ticks.
    """
    delay, slope, stretch, ticks = float(delay), float(slope), float(stretch), w.bits.shape[1]
    middle = (w.tick + ticks / 2 - timing.first) / timing.period
    period = timing.period * (1 + stretch / ticks)
    first = timing.first + delay - slope * _MIDDLE + middle * (timing.period - period)
    return replace(timing, first=first, period=period, slope=timing.slope + slope)


def _derivatives(
    w: Witnesses, timing: Timing, at: Floats, rule: str, noise: float = NOISE
) -> tuple[float, Floats, Floats]:
    """ln P, its derivatives (5,) and its information (5, 5)."""
    moved = _moved(timing, w, at[0], at[3], at[4])
    total, first, second = slopes(
        w.bits, w.light, moved.start(w.begin, w.rows), w.tick, moved.period, at[1], at[2],
        RULES.index(rule), noise, FLOOR, SKIP,
    )  # fmt: skip
    ticks = w.bits.shape[1]
    middle = (w.tick + ticks / 2 - timing.first) / timing.period
    # Derivatives of the kernel's four parameters (delay, delay by number, light, background) by
    # the five, for each pixel.
    by = np.zeros((len(w.rows), 4, 5))
    by[:, 0, 0] = by[:, 2, 1] = by[:, 3, 2] = 1
    by[:, 0, 3] = w.rows / timing.rows - _MIDDLE
    by[:, 0, 4] = timing.period / ticks * (w.begin - middle)
    by[:, 1, 4] = timing.period / ticks
    slope = np.einsum("na,nai->i", first, by)
    bend = np.tensordot(by, second @ by, ([0, 1], [0, 1]))
    return float(total.sum()), slope, bend


def _climb(
    w: Witnesses, timing: Timing, start: Floats, rule: str, free: npt.NDArray[np.bool_],
    prior_errors: Floats | None = None, unit: float = 1.0, noise: float = NOISE,
) -> _Top:  # fmt: skip
    """Maximises the likelihood over the free parameters, from `start` on.

    Args:
        w: the witnesses.
        timing: initial timing.
        start: (5,) parameters.
        rule: reset rule.
        free: (5,) bool.
        prior_errors: (5,) standard errors of a prior about 0, infinite without a prior.
        unit: unit of the stretch, ticks.
        noise: standard deviation of the charge at a spike, thresholds.
    """
    prior_errors = np.full(5, np.inf) if prior_errors is None else prior_errors
    units = np.array([1, 1, 1, 1, unit])
    box, stride = _BOX * units, _STRIDE * units
    prior = 1 / prior_errors**2

    def derivatives(at: Floats) -> tuple[float, Floats, Floats]:
        nats, slope, bend = _derivatives(w, timing, at, rule, noise)
        share = w.independent
        nats = nats * share - float(at**2 @ prior) / 2
        return nats, slope * share - prior * at, bend * share + np.diag(prior)

    at = np.clip(start, *box)
    nats, slope, bend = derivatives(at)
    damping, down, up, end = _DAMPING
    passes = 1
    while passes < _STEPS and damping < end:
        # A parameter at its limit that would exceed it stays there.
        stuck = ((at <= box[0]) & (slope < 0)) | ((at >= box[1]) & (slope > 0))
        of = np.flatnonzero(free & ~stuck & (np.diag(bend) > 0))
        if not len(of):
            break
        matrix = bend[np.ix_(of, of)]
        step = np.zeros(len(at))
        step[of] = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), slope[of])
        step = np.clip(at + np.clip(step, -stride, stride), *box) - at
        if abs(float(slope @ step)) < _TOP:
            break
        tried = derivatives(at + step)
        passes += 1
        if tried[0] > nats:
            at, (nats, slope, bend), damping = at + step, tried, damping * down
        else:
            damping *= up
    return _Top(at, nats, bend, passes)


def _error(top: _Top, free: npt.NDArray[np.bool_], which: int) -> float:
    """Standard error of a parameter with the other free ones unknown; inf without information."""
    of = np.flatnonzero(free & (np.diag(top.information) > 0))
    if which not in of:
        return float("inf")
    inverse = np.linalg.pinv(top.information[np.ix_(of, of)], hermitian=True)
    return float(np.sqrt(max(inverse[of == which, of == which][0], 0.0)))


def fit_timing(w: Witnesses, timing: Timing, span: float) -> Fit:
    """Timing and the light levels that maximise the likelihood of the spikes.

    Args:
        w: the witnesses.
        timing: initial timing.
        span: ticks over which the pilots gave the period of `timing`, which is trusted within three
            errors.
    """
    ticks = w.bits.shape[1]
    period_error = _PERIOD_ERROR * min(ticks / span, 1.0)
    prior_errors = np.array([np.inf, np.inf, np.inf, _SLOPE_ERROR, period_error])
    free = np.ones(5, np.bool_)
    few = w.some(_FEW)
    tops = []
    for rule in RULES:

        def nats(start: tuple[float, float, float], rule: str = rule) -> float:
            return likelihood(few, _moved(timing, w, start[0], 0, 0), *start[1:], rule)

        delay, on, _ = max(
            ((a, on, _BACKGROUNDS[0]) for on in _ONS for a in np.arange(*_PHASES)), key=nats
        )
        start = max(((delay, on, b) for b in _BACKGROUNDS), key=nats)
        tops.append((rule, _climb(few, timing, np.array([*start, 0, 0]), rule, free, prior_errors,
                                  period_error)))  # fmt: skip
    rule, top = max(tops, key=lambda each: each[1].nats)
    top = _climb(w, timing, top.at, rule, free, prior_errors, period_error)
    return Fit(
        _moved(timing, w, top.at[0], top.at[3], top.at[4]), _levels(w, top, rule),
        float(top.at[0]), _error(top, free, 4) / ticks, top.passes,
    )  # fmt: skip


def _levels(w: Witnesses, top: _Top, rule: str, noise: float = NOISE) -> Levels:
    count = len(w.rows) * max(w.bits.shape[1] - SKIP, 1) * w.independent
    return Levels(float(top.at[1]), float(top.at[2]), rule, top.nats / count, noise)


def fit_levels(w: Witnesses, timing: Timing, levels: Levels) -> Levels:
    """Light levels from witnesses that see several cells.

    Those determine the levels best: where whole cells fill a threshold or do not, parts of cells do
    either.
    """
    on = max(
        (*_ONS, levels.on),
        key=lambda on: likelihood(w, timing, on, levels.background, levels.reset),
    )
    free = np.array([False, True, True, False, False])
    start = np.array([0.0, on, max(levels.background, 1e-3), 0.0, 0.0])
    top = _climb(w, timing, start, levels.reset, free, noise=levels.noise)
    return _levels(w, top, levels.reset, levels.noise)


def measure_delay(w: Witnesses, timing: Timing, levels: Levels, reach: float = 0.0) -> Delay:
    """Delay of symbols against a nearly correct timing, at the nearest maximum, or at the one that
    begins from the likeliest of some phases within `reach` ticks.

    The error is large if light fills a threshold exactly, so that many phases explain the same
    spikes.
    """
    free = np.array([True, False, False, False, False])
    delay = _likeliest(w, timing, levels, reach)
    start = np.array([delay, levels.on, levels.background, 0.0, 0.0])
    top = _climb(w, timing, start, levels.reset, free, noise=levels.noise)
    return Delay(float(top.at[0]), _error(top, free, 0))


def fit_phase(
    w: Witnesses, timing: Timing, levels: Levels, reach: float = 0.0
) -> tuple[Delay, Levels]:
    """Delay as `measure_delay` and the light levels, fitted together."""
    free = np.array([True, True, True, False, False])
    delay = _likeliest(w, timing, levels, reach)
    start = np.array([delay, levels.on, max(levels.background, 1e-3), 0.0, 0.0])
    top = _climb(w, timing, start, levels.reset, free, noise=levels.noise)
    return Delay(float(top.at[0]), _error(top, free, 0)), _levels(
        w, top, levels.reset, levels.noise
    )


def _likeliest(w: Witnesses, timing: Timing, levels: Levels, reach: float) -> float:
    """The likeliest of _TRIED delays within `reach`: the slope of the likelihood jumps where
    symbols begin with ticks, and each side may have a maximum of its own."""
    if not reach:
        return 0.0
    delays = np.linspace(-reach, reach, _TRIED)
    moved = (replace(timing, first=timing.first + float(a)) for a in delays)
    return float(delays[np.argmax([likelihoods(w, one, levels).sum() for one in moved])])


def nudge(w: Witnesses, timing: Timing, levels: Levels) -> float:
    """Delay of the symbols against a nearly correct timing, ticks.

    It is 0 if that timing explains the spikes as well as any other, else the mean of the likely
    phases. If light fills a threshold exactly, many phases explain the same spikes, and which of
    them is the most likely is chance.
    """
    low, high = -_REACH, _REACH
    for _ in range(2):
        delay = np.linspace(low, high, _TRIED)
        fit = np.array(
            [
                likelihoods(w, replace(timing, first=timing.first + float(a)), levels).sum()
                for a in delay
            ]
        )
        nats = (fit - fit.max()) * w.independent
        if nats[_TRIED // 2] > -_HOLD and delay[_TRIED // 2] == 0:
            return 0.0
        likely, step = delay[nats > -_LIKELY], delay[1] - delay[0]
        low, high = float(likely[0] - step), float(likely[-1] + step)
    weight = np.exp(nats)
    return float(weight @ delay / weight.sum())


def followed_delay(
    recording: Recording, layout: Layout, registration: Registration, timing: Timing,
    levels: Levels, known: tuple[int, npt.NDArray[np.bool_]],
) -> Delay | None:  # fmt: skip
    """Delay of the last known symbols; None if the spikes do not determine it.

    Args:
        recording, layout, registration, timing, levels: recording, layout, registration, timing and
            levels of the transmission.
        known: the first known symbol, and the bits, (symbols, cells).
    """
    first, bits = known
    some = slice(max(len(bits) - _MEASURED, 0), None)
    cells = known_cells(layout, first + some.start, bits[some])
    w = choose_witnesses(recording, layout, registration, timing, cells)
    if w is None:
        return None
    delay = measure_delay(w, timing, levels)
    if delay.error > _SHARP:  # many phases may explain the spikes, the current one too
        delay = Delay(nudge(w, timing, levels), _SHARP)
        if delay.ticks == 0:
            return None
    return delay if abs(delay.ticks) < _FAR else None
