"""Distribution of the charge of a tick, on a grid: the transition probabilities of the trellis.

A pixel with share s of its light from a cell with bit b gathers off + s (on - off) b thresholds in
a tick, and the light of neighbouring cells, half of which are on at random. Arrivals are Poisson;
with other noise, normal with the sum of the variances.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from link.detect.pixel import PixelLaw

LEVELS = 40
"""Steps of charge in a threshold, unless it has fewer electrons."""
_TAIL = 1e-9
"""Probability below which a transition is omitted."""

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ChargeLaws:
    """Transition probabilities of a pixel's charge.

    Attributes:
        chance: (shares, fractions + 1, 2, 2, steps) float64, probability of gathering a number of
            steps, by the cell's bit before and after a symbol begins at a fraction of the tick; the
            last fraction stands for a tick without a begin.
        low, high: (shares, fractions + 1, 2, 2) int64, range of steps with a probability, high
            excluded.
        merged: (fractions + 1,) bool, whether the bit before has no light in the tick.
        levels: steps in a threshold.
        hard: whether a spike removes all charge.
    """

    chance: Values
    low: npt.NDArray[np.int64]
    high: npt.NDArray[np.int64]
    merged: npt.NDArray[np.bool_]
    levels: int
    hard: bool


def charge_laws(
    pixel: PixelLaw, shares: npt.ArrayLike, fractions: npt.ArrayLike, levels: int = LEVELS
) -> ChargeLaws:
    """Transition probabilities.

    Args:
        pixel: the pixel; light and reset must be known.
        shares: (shares,) share of the pixel's light from the cell.
        fractions: (fractions,) fraction of a tick at which a symbol begins.
        levels: steps in a threshold.

    Raises:
        ValueError: if the light or the reset of the pixel is None.
    """
    from scipy.stats import norm, poisson

    if pixel.off is None or pixel.on is None or pixel.reset is None:
        raise ValueError("the pixel's light and reset must be given or learned")
    part = np.asarray(shares, np.float64)
    at = np.append(np.asarray(fractions, np.float64), 1.0)
    levels = max(min(levels, int(pixel.threshold)), 2)
    bits = np.arange(2)
    # (shares, fractions, before, after); at fraction 1 no symbol begins and the bit before counts
    lit = at[:, None, None] * bits[:, None] + (1 - at)[:, None, None] * bits
    swing, others = pixel.on - pixel.off, 1 - part
    mean = pixel.off + swing * (part[:, None, None, None] * lit + others[:, None, None, None] / 2)
    electrons, step = mean * pixel.threshold, pixel.threshold / levels
    other = pixel.noise**2 + (swing * others * pixel.threshold / 2) ** 2
    spread = np.sqrt(electrons + other[:, None, None, None])
    steps = int(np.ceil((electrons + 8 * spread).max() / step)) + 2
    edge = (np.arange(steps + 1) - 0.5) * step
    below = norm.cdf(edge, electrons[..., None], np.maximum(spread, 1e-9)[..., None])
    below[..., 0] = 0.0
    plain = other == 0
    below[plain] = poisson.cdf(np.ceil(edge) - 1, electrons[plain][..., None])
    chance = np.diff(below)
    chance /= chance.sum(axis=-1, keepdims=True)
    possible = chance > _TAIL
    low = possible.argmax(axis=-1)
    high = steps - possible[..., ::-1].argmax(axis=-1)
    return ChargeLaws(
        chance, low.astype(np.int64), high.astype(np.int64), at == 0, levels,
        pixel.reset == "hard",
    )  # fmt: skip
