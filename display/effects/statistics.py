"""Statistics of a tile's light on a panel: its flutter and its changes, relative to its mean.

Light is in packets Q a cycle, so its mean is the spike rate r. The latch rounds spikes up to edges,
and noise of relative spread s moves them. Time enters in planes (cycles).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Summary
from display.drives import Drive

__all__ = ["base", "flutter", "spread", "unlit_rate", "unsteady", "worst_rate"]

Values = npt.NDArray[np.float64]
_RATES: Final = 9
"""Rates between a tile's least and most at which an estimate is tried."""
_LATE: Final = 4.0
"""Relative spreads by which an interval is longer, at most."""


def _bounds(scene: Summary) -> tuple[Values, Values]:
    """Least and most spikes a cycle of each tile; the latch counts one at most."""
    low, high = np.broadcast_arrays(
        np.asarray(scene.darkest, np.float64), np.asarray(scene.brightest, np.float64)
    )
    return np.minimum(low / scene.threshold, 1.0), np.minimum(high / scene.threshold, 1.0)


def worst_rate(scene: Summary) -> Values:
    """(rates, tiles) spikes a cycle that a tile's pixels may have, evenly in their logarithm."""
    low, high = _bounds(scene)
    low = np.maximum(low, np.minimum(high, max(scene.floor, 1e-9) / 10))
    share = np.linspace(0, 1, _RATES)[:, None]
    ratio = np.ones_like(low)
    np.divide(high, low, out=ratio, where=low > 0)
    return np.asarray(np.atleast_1d(low) * np.atleast_1d(ratio) ** share)


def base(scene: Summary, loss: float) -> Values:
    """Spikes a cycle that a tile's pixels show at least, or the floor. loss: most that the phases
    of the spikes take off, in packets."""
    low, _ = _bounds(scene)
    held = low / scene.slack - loss if scene.spread == 0 and scene.dead == 0 else np.zeros_like(low)
    return np.asarray(np.maximum(np.maximum(held, scene.floor), 1e-300))


def spread(scene: Summary) -> Values:
    """Half the range of a tile's light over its mean or the floor: amplitude of light that goes
    between its ends."""
    low, high = _bounds(scene)
    return np.asarray((high - low) / np.maximum(high + low, 2 * max(scene.floor, 1e-300)))


def unlit_rate(scene: Summary, unseen: int, spikes: int) -> tuple[Values, Values]:
    """Rate, over the mean or the floor, of the brightest of a tile's pixels that may be without so
    many spikes (and so dark) when the first `unseen` planes are over: as many intervals, each up to
    _LATE spreads longer. And the planes of an interval of such a pixel."""
    low, high = _bounds(scene)
    at = np.minimum(high, spikes * (1 + _LATE * scene.spread) * scene.slack / max(unseen, 1))
    rate = np.where(at < low, 0.0, at / np.maximum(at, max(scene.floor, 1e-300)))
    return rate, 1 / np.maximum(at, 1e-12)


def _interval(scene: Summary, rate: Values) -> Values:
    """Variance of 1 / tau over rate, squared: Gamma intervals of relative spread s have s^2 / (1 -
    s^2), at most what a cycle as the shortest leaves of it; rounding both ends r^2 / 6."""
    s2 = scene.spread**2
    most = np.log(1 / np.clip(rate, 1e-12, 0.99)) + 1
    noise = np.minimum(s2 / max(1 - s2, 1e-9), most)
    return np.asarray(noise + rate**2 / 6)


def flutter(scene: Summary, drive: Drive, reach: float) -> Values:
    """(tiles,) standard deviation of a plane's light about its mean, over the mean or the floor,
    times the root of the planes for which it stays the same. reach: planes within which changed
    weights turn."""
    rate = worst_rate(scene)
    deviation = drive.flutter(rate, _interval(scene, rate), reach)
    return np.asarray((deviation / np.maximum(rate, max(scene.floor, 1e-300))).max(axis=0))


def unsteady(scene: Summary, drive: Drive, swing: float) -> Values:
    """(tiles,) how far the light goes up and down in a plane, over the mean or the floor. swing: of
    the emitter with a packet, in Q a cycle."""
    rate = worst_rate(scene)
    motion = 2 * spread(scene) * (np.asarray(scene.planes) > 0)
    each = drive.unsteadiness(rate, _interval(scene, rate), motion, swing)
    return np.asarray((rate * each / np.maximum(rate, max(scene.floor, 1e-300))).max(axis=0))
