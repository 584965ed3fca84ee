"""The weak error of stretches of unsent spikes: distributions are compared, not samples.

The engine draws the charge of a whole stretch at once (`pixel/skipping.py`), so that its random
numbers are not those of the single spikes. The mean and the variance of the charge of a stretch are
compared with the closed forms of one interval, and so are those of spikes drawn one by one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.plan.error import DEVIATIONS
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.pixel.closed import width_law
from sensor.asynchronous.pixel.reference import exact_thresholds
from sensor.asynchronous.pixel.stretches import LEAST, RARE, stretch

_SPARE: Final = 64
"""Thresholds drawn beyond those needed, for those that would have been sent."""

Reals = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WeakError:
    """Errors as (engine, reference, half width of 99.9 % of either by chance).

    Attributes:
        intervals, pixels: number of unsent intervals, and of their pixels.
        mean: mean of the charge, relative to the closed form.
        variance: variance of the charge's deviation over the closed form, less 1.
    """

    intervals: int
    pixels: int
    mean: tuple[float, float, float]
    variance: tuple[float, float, float]


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, error_model="numpy", nogil=True)
def _stretches(  # type: ignore[no-untyped-def]
    numbers, rates, sent, q, delay, shortest, relative, many, seed, laws, sums
):
    """laws: (n, 6): p, a, b, mean, variance and the charge that the shortest width lets in."""
    for n in range(numbers.size):
        rate = rates[n]
        p, a, b, mean, variance, third = width_law(
            q,
            True,
            rate,
            delay,
            shortest,
            0,
            sent[n] * (1.0 - relative),
            sent[n] * (1.0 + relative),
        )
        held = max(rate * (shortest - delay), 0.0)
        laws[n] = p, a, b, mean, variance, held
        sums[n] = stretch(
            many, mean, variance, third, max(a, held), np.uint64(numbers[n]), np.uint64(1), seed
        )


def weak_error(
    model: EventModel, numbers: npt.NDArray[np.uint32], rates: Reals
) -> WeakError | None:
    """Weak error of pixels under steady light over the LEAST intervals after the first width. None
    where fewer than a quarter of them have stretches. rates: (n,) electrons a picosecond."""
    if not (model.shot and model.change) or model.longest:
        return None
    q = float(model.threshold)
    drawn = exact_thresholds(model, numbers, 1 + LEAST + _SPARE)
    sent = np.maximum(drawn[:, 0] / rates + model.delay, model.shortest)
    laws, sums = np.zeros((numbers.size, 6)), np.zeros(numbers.size)
    _stretches(
        numbers, rates, sent, q, model.delay, model.shortest, model.change / math.sqrt(q), LEAST,
        np.uint64(model.seed), laws, sums,
    )  # fmt: skip
    p, a, b, mean, variance, held = laws.T
    later = drawn[:, 1:]
    unsent = (later >= a[:, None]) & (later <= b[:, None])
    nth = np.cumsum(unsent, axis=1)
    chosen = unsent & (nth <= LEAST)
    good = (p <= RARE) & (nth[:, -1] >= LEAST) & (variance > 0)
    if good.sum() * 4 < numbers.size:
        return None
    single = np.where(chosen, np.maximum(later, held[:, None]), 0.0).sum(1)[good]
    whole, spread = LEAST * mean[good], LEAST * variance[good]
    n = int(good.sum())

    def off(charges: Reals) -> tuple[float, float]:
        apart = charges - whole
        return float(apart.sum() / whole.sum()), float((apart**2 / spread).mean() - 1)

    engine, reference = off(sums[good]), off(single)
    return WeakError(
        LEAST,
        n,
        (engine[0], reference[0], DEVIATIONS * math.sqrt(float(spread.sum())) / float(whole.sum())),
        (engine[1], reference[1], DEVIATIONS * math.sqrt(2 / n)),
    )
