"""Ticks that a recording lacks, found by the sequence of the pilots.

A camera or a file that drops a tick moves all that follows one tick ahead. A transmission that is
longer than the searched ticks loses a block by that. A short one is lost: its only timing is then
wrong before the gap or after it, and for the detector that learns across it in both.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.receiving.pilots.sequence import sequence_peak, sequence_values
from link.receiving.pilots.signal import PilotSignal
from link.receiving.recording import Gap

Floats = npt.NDArray[np.float64]
_MOST: Final = 8
"""Missing ticks at a place, at most. Where more are missing the light may have been broken."""
_NEAR: Final = 1.0
"""Ticks on each side of the peak of the sequence in which its begin is searched."""
_STEP: Final = 0.25
"""Step of that search, and of the drift, ticks."""
_DRIFT: Final = 3.0
"""Largest drift of the clocks over the searched ticks that may explain the pilots without a gap,
ticks: that of 2000 parts per million over 1000 ticks, and what a gap itself resembles."""
_NOISE: Final = 0.05
"""Least standard deviation of the pilots' spikes about a straight line, share of their range."""
_NATS: Final = 15.0
"""Log likelihood ratio from which a gap is believed, over the best explanation without one. Some
10 000 places and lengths are compared: ln of that is 9."""
_EXPLAINED: Final = 0.6
"""Share of the pilots' variance that a gap must explain, together with the sequence."""
_LIKELY: Final = 5.0
"""Nats below the likeliest place of a gap within which others count."""


def missing_ticks(signal: PilotSignal, symbol: float, lit: tuple[int, int]) -> Gap | None:
    """The likeliest gap; None if the pilots go on without one, or do not tell.

    A straight line is fitted to the spikes of the pilots over the values of the sequence, once with
    a gap at any place and once with a drift of the clocks instead. The residuals are taken to be
    Gaussian, so that the log likelihood ratio is ticks / 2 ln(ratio of the variances).

    Args:
        signal: spikes of the pilots.
        symbol: ticks of a symbol.
        lit: ticks in which the panel is on.
    """
    low, high = max(lit[0] - signal.first, 0), min(lit[1] - signal.first, len(signal.bits))
    total = (signal.bits @ (signal.pixels / signal.pixels.sum()))[low:high]
    count = len(total)
    if count < 8 * symbol or np.ptp(total) == 0:
        return None
    ticks = np.arange(count, dtype=np.float64)
    drift = np.arange(-_DRIFT, _DRIFT + _STEP / 2, _STEP)
    reach = np.arange(-_NEAR, _NEAR + _STEP / 2, _STEP)
    floor = _NOISE**2 * count * float(np.ptp(total)) ** 2
    without = best = np.inf
    found = None
    third = count // 3
    for begin, end in ((0, count), (0, count - third), (third, count)):
        lag, _ = sequence_peak(total[begin:end], symbol)
        near = begin - lag + reach
        # A drift about the middle: period and begin are then independent.
        for late in drift:
            codes = sequence_values(near + late / 2, symbol * (1 - late / count), ticks)
            without = min(without, float(_residual(total, codes).min()))
        for missing in range(1, _MOST + 1):
            for shift in (0, missing):  # the peak is of what follows the gap, or what precedes it
                before = sequence_values(near + shift, symbol, ticks)
                after = sequence_values(near + shift - missing, symbol, ticks)
                left = _left_by_place(total, before, after)
                if left.min() < best:
                    best, found = float(left.min()), (missing, left)
    ratio = np.log((without + floor) / (best + floor)) * count / 2
    explained = 1 - best / float(np.sum((total - total.mean()) ** 2))
    if found is None or ratio < _NATS or explained < _EXPLAINED:
        return None
    missing, left = found
    likely = np.log((left + floor) / (best + floor)) * count / 2 < _LIKELY
    first = last = int(np.argmin(left))
    while first > 1 and likely[first - 1]:
        first -= 1
    while last < count - 1 and likely[last + 1]:
        last += 1
    start = signal.first + low
    return Gap(start + first, missing, start + last)


def _residual(total: Floats, codes: Floats) -> Floats:
    """Sum of squares of (ticks,) that straight lines over (n, ticks) leave, (n,)."""
    y, x = total - total.mean(), codes - codes.mean(axis=1, keepdims=True)
    return np.asarray(y @ y - (x @ y) ** 2 / np.maximum(np.sum(x * x, axis=1), 1e-12))


def _left_by_place(total: Floats, before: Floats, after: Floats) -> Floats:
    """Sum of squares that straight lines leave over the first m ticks of `before` and the others of
    `after`, (n, ticks), by m, (ticks + 1,): of the best of n."""
    count = len(total)

    def sums(value: Floats) -> Floats:
        first, last = value
        begun = np.concatenate([np.zeros((len(first), 1)), np.cumsum(first, axis=1)], axis=1)
        ended = np.concatenate([np.zeros((len(last), 1)), np.cumsum(last, axis=1)], axis=1)
        return begun + ended[:, -1:] - ended

    y = total - total.mean()
    both = np.stack([before, after])
    spread = sums(both**2) - sums(both) ** 2 / count
    left = y @ y - sums(both * y) ** 2 / np.maximum(spread, 1e-12)
    return np.asarray(left.min(axis=0))
