"""When symbols begin and how bright they are, to hundredths of a tick, from known symbols.

Spikes of computed pixels (`synthesis`) are made likeliest by Fisher scoring with Levenberg's and
Marquardt's damping (Osborne, Int. Stat. Rev. 60:99, 1992; Marquardt, SIAM J. Appl. Math. 11:431,
1963): the slope and the information come with the likelihood from one pass over the bits, so five
to thirty passes find the top to a fifth of its standard errors. Nelder and Mead's simplex took 300
to 600 for five numbers; cut at 130, it ended far from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.receiving.kernels import slopes
from link.receiving.pacing import Delay
from link.receiving.synthesis import (
    FLOOR,
    NOISE,
    RULES,
    SKIP,
    Levels,
    Witnesses,
    likelihood,
    likelihoods,
)
from link.timing import Timing

__all__ = ["Fit", "fit_levels", "fit_timing", "measure_delay", "nudge"]

Floats = npt.NDArray[np.float64]
_PHASES: Final = (-1.0, 1.0, 0.125)
_ONS: Final = (0.6, 1.0, 1.4, 2.0, 3.0)
_BACKGROUNDS: Final = (0.02, 0.1, 0.25)
_FEW: Final = 200
"""Pixels of the first search."""
_MIDDLE: Final = 0.5
"""Of the rows."""
_SLOPE_ERROR, _PERIOD_ERROR = 0.1, 0.1
"""Ticks over the rows, and over the time that pilots were seen, by which their plane may be wrong.
"""
_BOX: Final = np.array([[-1.5, 0.1, 0.0, -0.5, -3.0], [1.5, 10.0, 1.0, 0.5, 3.0]])
"""Of lateness, light, background, slope, and stretch in errors of the pilots' period."""
_STRIDE: Final = np.array([0.2, 0.4, 0.1, 0.1, 1.0])
"""Of the same, most of a step."""
_TOP: Final = 0.02
"""Nats that a further step would gain where a climb ends: a standard error is half a nat."""
_STEPS: Final = 40
_DAMPING: Final = (1e-3, 0.2, 5.0, 1e7)
"""Marquardt's: at first, its factors after a step up and after one that failed, and its end."""
_REACH, _TRIED = 0.5, 17
"""Ticks to each side in which a middle is looked for, and phases that are tried at a time."""
_KEPT: Final = 3.0
"""Nats below the likeliest phase down to which one that is held is kept."""
_LIKELY: Final = 10.0
"""Nats below the likeliest phase down to which others count."""


@dataclass(frozen=True)
class Fit:
    """late: ticks by which symbols are later in the middle than they were told. drift: standard
    error of the period, ticks a tick, of chance alone. passes: over the spikes of all pixels."""

    timing: Timing
    levels: Levels
    late: float
    drift: float
    passes: int


@dataclass(frozen=True, eq=False)
class _Top:
    """at: (5,) late, on, background, slope, stretch. nats: ln P less what the prior takes.
    information: (5, 5), prior included."""

    at: Floats
    nats: float
    information: Floats
    passes: int


def _moved(timing: Timing, w: Witnesses, late: float, slope: float, stretch: float) -> Timing:
    """Later by `late` ticks in the middle of the witnesses, by `slope` more over all rows, and by
    `stretch` more over the witnesses' time."""
    late, slope, stretch, ticks = float(late), float(slope), float(stretch), w.bits.shape[1]
    middle = (w.tick + ticks / 2 - timing.first) / timing.period
    period = timing.period * (1 + stretch / ticks)
    first = timing.first + late - slope * _MIDDLE + middle * (timing.period - period)
    return replace(timing, first=first, period=period, slope=timing.slope + slope)


def _look(w: Witnesses, timing: Timing, at: Floats, rule: str) -> tuple[float, Floats, Floats]:
    """ln P, its derivatives (5,) and its information (5, 5)."""
    moved = _moved(timing, w, at[0], at[3], at[4])
    total, first, second = slopes(
        w.bits, w.light, moved.start(w.begin, w.rows), w.tick, moved.period, at[1], at[2],
        RULES.index(rule), NOISE, FLOOR, SKIP,
    )  # fmt: skip
    ticks = w.bits.shape[1]
    middle = (w.tick + ticks / 2 - timing.first) / timing.period
    # of each pixel, what the five move of what the pass knows: lateness, lateness by number,
    # light, background
    by = np.zeros((len(w.rows), 4, 5))
    by[:, 0, 0] = by[:, 2, 1] = by[:, 3, 2] = 1
    by[:, 0, 3] = w.rows / timing.rows - _MIDDLE
    by[:, 0, 4] = timing.period / ticks * (w.begin - middle)
    by[:, 1, 4] = timing.period / ticks
    slope = np.einsum("na,nai->i", first, by)
    bend = np.einsum("nab,nai,nbj->ij", second, by, by, optimize=True)
    return float(total.sum()), slope, bend


def _climb(
    w: Witnesses, timing: Timing, start: Floats, rule: str, free: npt.NDArray[np.bool_],
    held: Floats | None = None, unit: float = 1.0,
) -> _Top:  # fmt: skip
    """The likeliest of what is free, from `start` up. held: (5,) standard errors of the prior about
    0, inf where there is none. unit: of the stretch."""
    held = np.full(5, np.inf) if held is None else held
    units = np.array([1, 1, 1, 1, unit])
    box, stride = _BOX * units, _STRIDE * units
    prior = 1 / held**2

    def derivatives(at: Floats) -> tuple[float, Floats, Floats]:
        nats, slope, bend = _look(w, timing, at, rule)
        share = w.independent
        nats = nats * share - float(at**2 @ prior) / 2
        return nats, slope * share - prior * at, bend * share + np.diag(prior)

    at = np.clip(start, *box)
    nats, slope, bend = derivatives(at)
    damping, down, up, end = _DAMPING
    passes = 1
    while passes < _STEPS and damping < end:
        # what stands at its limit and would go beyond stays there
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
    """Standard error of one of the five, the other free ones unknown; inf where nothing tells."""
    of = np.flatnonzero(free & (np.diag(top.information) > 0))
    if which not in of:
        return float("inf")
    inverse = np.linalg.pinv(top.information[np.ix_(of, of)], hermitian=True)
    return float(np.sqrt(max(inverse[of == which, of == which][0], 0.0)))


def fit_timing(w: Witnesses, timing: Timing, span: float) -> Fit:
    """The timing that makes the spikes likeliest, and the light's levels. span: ticks over which
    the pilots told the period of `timing`, which is believed within three errors."""
    ticks = w.bits.shape[1]
    period_error = _PERIOD_ERROR * min(ticks / span, 1.0)
    held = np.array([np.inf, np.inf, np.inf, _SLOPE_ERROR, period_error])
    free = np.ones(5, np.bool_)
    few = w.some(_FEW)
    tops = []
    for rule in RULES:

        def nats(start: tuple[float, float, float], rule: str = rule) -> float:
            return likelihood(few, _moved(timing, w, start[0], 0, 0), *start[1:], rule)

        late, on, _ = max(
            ((a, on, _BACKGROUNDS[0]) for on in _ONS for a in np.arange(*_PHASES)), key=nats
        )
        start = max(((late, on, b) for b in _BACKGROUNDS), key=nats)
        tops.append((rule, _climb(few, timing, np.array([*start, 0, 0]), rule, free, held,
                                  period_error)))  # fmt: skip
    rule, top = max(tops, key=lambda each: each[1].nats)
    top = _climb(w, timing, top.at, rule, free, held, period_error)
    return Fit(
        _moved(timing, w, top.at[0], top.at[3], top.at[4]), _levels(w, top, rule),
        float(top.at[0]), _error(top, free, 4) / ticks, top.passes,
    )  # fmt: skip


def _levels(w: Witnesses, top: _Top, rule: str) -> Levels:
    count = len(w.rows) * max(w.bits.shape[1] - SKIP, 1) * w.independent
    return Levels(float(top.at[1]), float(top.at[2]), rule, top.nats / count)


def fit_levels(w: Witnesses, timing: Timing, levels: Levels) -> Levels:
    """The light's levels by witnesses that are not pure: those tell them best, since light that
    fills a threshold or does not in whole cells does either in parts of them."""
    on = max(
        (*_ONS, levels.on),
        key=lambda on: likelihood(w, timing, on, levels.background, levels.reset),
    )
    free = np.array([False, True, True, False, False])
    start = np.array([0.0, on, max(levels.background, 1e-3), 0.0, 0.0])
    top = _climb(w, timing, start, levels.reset, free)
    return _levels(w, top, levels.reset)


def measure_delay(w: Witnesses, timing: Timing, levels: Levels) -> Delay:
    """How late symbols are against a timing that is nearly right, by the nearest top. The error is
    large where light fills a threshold or does not, and many phases explain the same spikes."""
    free = np.array([True, False, False, False, False])
    start = np.array([0.0, levels.on, levels.background, 0.0, 0.0])
    top = _climb(w, timing, start, levels.reset, free)
    return Delay(float(top.at[0]), _error(top, free, 0))


def nudge(w: Witnesses, timing: Timing, levels: Levels) -> float:
    """Ticks by which the symbols are late against a timing that is nearly right: 0 where that
    explains the spikes as well as any, else the mean of what is likely. Where light fills a
    threshold or does not, many phases explain the same spikes, and the likeliest of them is one by
    chance."""
    low, high = -_REACH, _REACH
    for _ in range(2):
        late = np.linspace(low, high, _TRIED)
        fit = np.array(
            [
                likelihoods(w, replace(timing, first=timing.first + float(a)), levels).sum()
                for a in late
            ]
        )
        nats = (fit - fit.max()) * w.independent
        if nats[_TRIED // 2] > -_KEPT and late[_TRIED // 2] == 0:
            return 0.0
        likely, step = late[nats > -_LIKELY], late[1] - late[0]
        low, high = float(likely[0] - step), float(likely[-1] + step)
    weight = np.exp(nats)
    return float(weight @ late / weight.sum())
