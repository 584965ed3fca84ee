"""What a pixel gathers in a tick, on a grid of charge: the laws of the trellis.

A pixel with share s of its light from a cell with bit b gathers off + s (on - off) b thresholds a
tick, and the light of the cells beside it, of which half is on by chance. Arrivals are Poisson;
where other noise joins, normal with the sum of the variances.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from link.detect.pixel import PixelLaw

__all__ = ["LEVELS", "ChargeLaws", "charge_laws"]

LEVELS = 40
"""Steps of charge to a threshold, unless it has fewer electrons."""
_TAIL = 1e-9
"""Of a law, left out."""

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ChargeLaws:
    """chance: (shares, fractions + 1, 2, 2, steps) float64 of gathering so many steps, by the
    cell's bit before and after a symbol begins at a fraction of the tick; the last fraction is a
    tick in which none begins. low, high: steps with a chance, high excluded. merged: (fractions +
    1,) bool, where the bit before has no light in the tick. levels: steps to a threshold. hard:
    whether a spike takes all charge away."""

    chance: Values
    low: npt.NDArray[np.int64]
    high: npt.NDArray[np.int64]
    merged: npt.NDArray[np.bool_]
    levels: int
    hard: bool


def charge_laws(
    pixel: PixelLaw, shares: npt.ArrayLike, fractions: npt.ArrayLike, levels: int = LEVELS
) -> ChargeLaws:
    """Raises ValueError where pixel leaves its light or reset open."""
    from scipy.stats import norm, poisson

    if pixel.off is None or pixel.on is None or pixel.reset is None:
        raise ValueError("the pixel's light and reset must be given or learned")
    part = np.asarray(shares, np.float64)
    at = np.append(np.asarray(fractions, np.float64), 1.0)
    levels = max(min(levels, int(pixel.threshold)), 2)
    bits = np.arange(2)
    # (shares, fractions, before, after); no symbol begins at fraction 1: the bit before counts
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
    there = chance > _TAIL
    low = there.argmax(axis=-1)
    high = steps - there[..., ::-1].argmax(axis=-1)
    return ChargeLaws(
        chance, low.astype(np.int64), high.astype(np.int64), at == 0, levels,
        pixel.reset == "hard",
    )  # fmt: skip
