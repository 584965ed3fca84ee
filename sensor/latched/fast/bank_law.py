"""The law of spikes whose thresholds come from the bank, beside that of a draw for each spike.

All figures are computed from the entries of the bank itself (sensor/latched/pixel/bank.py), without
chance. Intervals are compared as the latch sees them: an interval of charge X begins at a random
place of a cycle with the light L, so it spans k cycles with the probability E[(1 - |X / L - k|)+].
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import Law, LawFigure
from sensor.latched.fast.units import units_of
from sensor.latched.pixel.bank import LANES, SIZE, bank_of, plain_model
from sensor.latched.pixel.charge import ONE
from sensor.latched.pixel.interval import threshold
from sensor.latched.pixel.model import ExactModel

Values = npt.NDArray[np.float64]

SERIAL: Final = 1e-5
"""Limit of the correlation of two draws of a group in different cycles. Over all 2^32 states of the
generator it is below 2e-6 where it was counted; thresholds in a random order give 4096 states of a
cell's 256 a scatter of this size."""
_DRAWN: Final = 1 << 16
"""Quantiles that stand for the distribution of a threshold, each the middle of an equal share."""
_STEPS: Final = 4
"""Rates of an octave at which intervals are compared."""
_RATES: Final = (2.0**-10, 4.0)
"""Spikes a cycle within which they are: darker pixels have no bank, brighter ones lose thresholds
at their mean."""


@lru_cache(maxsize=8)
def _thresholds(model: ExactModel) -> tuple[Values, Values]:
    """Thresholds over their mean: those of the bank, (SIZE,), and equally likely ones of the
    distribution, (_DRAWN,)."""
    bits = units_of(model).bits
    bank = bank_of(model, bits).values[:SIZE] / 2.0**bits
    words = (np.arange(_DRAWN, dtype=np.uint32) * 2 + 1) << np.uint32(15)
    drawn = threshold(model.table(), words) / (ONE * model.mean)
    return bank, np.asarray(drawn)


def _latched(thresholds: Values, light: float, most: int) -> Values:
    """Probabilities of latched intervals of 0 to `most` cycles. light: thresholds a cycle."""
    cycles = thresholds / light
    whole = np.floor(cycles)
    part, first = cycles - whole, whole.astype(np.intp)
    found = np.bincount(first, 1 - part, most + 2) + np.bincount(first + 1, part, most + 2)
    return np.asarray(found / thresholds.size)


@lru_cache(maxsize=256)
def _interval_tv(model: ExactModel, step: int) -> float:
    """Total variation distance of latched intervals at 2^(step / _STEPS) spikes a cycle."""
    light = 2.0 ** (step / _STEPS)
    bank, drawn = _thresholds(model)
    most = int(max(bank.max(), drawn.max()) / light) + 1
    found = _latched(bank, light, most) - _latched(drawn, light, most)
    return float(np.abs(found).sum() / 2)


@lru_cache(maxsize=32)
def _neighbours(model: ExactModel) -> float:
    """Largest correlation of two entries of a stretch that a group reads."""
    bank = _thresholds(model)[0]
    about = (bank - bank.mean()) / bank.std()
    return max(abs(float((about * np.roll(about, lag)).mean())) for lag in range(1, LANES))


def bank_law(model: ExactModel, darkest: Values, brightest: Values) -> Law:
    """Change of the law of spikes by the bank.

    Args:
        model: a model that has a bank.
        darkest, brightest: (tiles,) least and largest rate of the tiles that take it, spikes a
            cycle.
    """
    ends = np.clip([darkest.min(), brightest.max()], *_RATES)
    low, high = np.floor(np.log2(ends[0]) * _STEPS), np.ceil(np.log2(ends[1]) * _STEPS)
    return _law(plain_model(model), int(low), int(high))


@lru_cache(maxsize=32)
def _law(own: ExactModel, low: int, high: int) -> Law:
    """`bank_law` at the rates of the steps from `low` to `high`; calls of a camera share it."""
    bank = _thresholds(own)[0]
    variance = own.shot * own.threshold + own.threshold_noise**2
    mean = abs(float(bank.mean()) - 1)
    spread = abs(float(bank.var()) * own.mean**2 / variance - 1)
    apart = [_interval_tv(own, step) for step in range(low, high + 1)]
    correlation = max(_neighbours(own), SERIAL)
    return Law(
        LawFigure(mean, (mean, mean)), LawFigure(spread, (spread, spread)),
        LawFigure(max(apart), (min(apart), max(apart))),
        LawFigure(correlation, (correlation, correlation)),
    )  # fmt: skip
