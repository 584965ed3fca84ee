"""Statistics of the light of a tile on a panel: its fluctuation and its changes over its mean.

Light is in packets Q a cycle, so its mean is the spike rate r. The latch delays spikes to clock
edges, and noise of relative spread s shifts them. Times are in planes (cycles).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Summary
from display.drives import Drive

Values = npt.NDArray[np.float64]
_RATES: Final = 9
"""Number of rates within the range of a tile for which an estimate is evaluated."""
_LONGEST: Final = 4.0
"""Excess of the longest interval over the mean, in relative spreads."""


def _bounds(scene: Summary) -> tuple[Values, Values]:
    """Least and greatest rate of each tile, spikes a cycle; the latch limits it to one."""
    low, high = np.broadcast_arrays(
        np.asarray(scene.darkest, np.float64), np.asarray(scene.brightest, np.float64)
    )
    return np.minimum(low / scene.threshold, 1.0), np.minimum(high / scene.threshold, 1.0)


def worst_rate(scene: Summary) -> Values:
    """Possible rates of the pixels of each tile, (rates, tiles), spikes a cycle, equidistant in
    their logarithm."""
    low, high = _bounds(scene)
    low = np.maximum(low, np.minimum(high, max(scene.floor, 1e-9) / 10))
    share = np.linspace(0, 1, _RATES)[:, None]
    ratio = np.ones_like(low)
    np.divide(high, low, out=ratio, where=low > 0)
    return np.asarray(np.atleast_1d(low) * np.atleast_1d(ratio) ** share)


def base(scene: Summary, loss: float) -> Values:
    """Least mean light of the pixels of each tile, or the floor, packets a cycle. `loss`: upper
    limit of the effect of the phases of the spikes, packets."""
    low, _ = _bounds(scene)
    least = low / scene.slack - loss if scene.spread == scene.dead == 0 else np.zeros_like(low)
    return np.asarray(np.maximum(np.maximum(least, scene.floor), 1e-300))


def spread(scene: Summary) -> Values:
    """Half the range of the light of each tile over its mean or the floor: the amplitude of light
    that varies over the range."""
    low, high = _bounds(scene)
    return np.asarray((high - low) / np.maximum(high + low, 2 * max(scene.floor, 1e-300)))


def dark_rate(scene: Summary, unseen: int, spikes: int) -> tuple[Values, Values]:
    """The brightest pixels of each tile that may still be dark after the first `unseen` planes,
    because they have fired less than `spikes` times.

    Returns:
        Their rate over the mean or the floor, (tiles,), and their mean interval, planes.
    """
    low, high = _bounds(scene)
    at = np.minimum(high, spikes * (1 + _LONGEST * scene.spread) * scene.slack / max(unseen, 1))
    rate = np.where(at < low, 0.0, at / np.maximum(at, max(scene.floor, 1e-300)))
    return rate, 1 / np.maximum(at, 1e-12)


def _interval(scene: Summary, rate: Values) -> Values:
    """Variance of 1 / tau over the squared rate. Gamma-distributed intervals of relative spread s
    have s^2 / (1 - s^2), limited by the shortest interval of one cycle; the rounding of both ends
    adds r^2 / 6."""
    s2 = scene.spread**2
    most = np.log(1 / np.clip(rate, 1e-12, 0.99)) + 1
    noise = np.minimum(s2 / max(1 - s2, 1e-9), most)
    return np.asarray(noise + rate**2 / 6)


def fluctuation(scene: Summary, drive: Drive, reach: float) -> Values:
    """Standard deviation of the light of a plane over the mean or the floor, times the root of the
    number of planes for which it is constant, (tiles,). `reach`: see `Drive.fluctuation`."""
    rate = worst_rate(scene)
    deviation = drive.fluctuation(rate, _interval(scene, rate), reach)
    return np.asarray((deviation / np.maximum(rate, max(scene.floor, 1e-300))).max(axis=0))


def total_variation(scene: Summary, drive: Drive, swing: float) -> Values:
    """Total variation of the light in a plane, over the mean or the floor, (tiles,). `swing`:
    change of the emitter's level by a packet, Q a cycle."""
    rate = worst_rate(scene)
    motion = 2 * spread(scene) * (np.asarray(scene.planes) > 0)
    each = drive.variation(rate, _interval(scene, rate), motion, swing)
    return np.asarray((rate * each / np.maximum(rate, max(scene.floor, 1e-300))).max(axis=0))
