"""What a window of a pixel's spikes sees of an error: shared by the bounds of the effects.

A rate counts fractions, bits plus the change of stored charge over its interval's own threshold,
so it is smooth in the charge gathered. Three things move it: the charge itself; the noise of the
thresholds, which the window sees elsewhere once the spikes have shifted; and the latch, which
counts two spikes in one cycle as one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Summary

__all__ = ["bound_of", "clipped", "contrast", "lost", "noisy", "saturated", "shifted"]

Values = npt.NDArray[np.float64]
_CLEAR = 8.0
"""Spreads by which light stays clear of a threshold to fire in every cycle."""


def saturated(scene: Summary) -> npt.NDArray[np.bool_]:
    """Where every pixel fires in every cycle whatever the noise draws: _CLEAR spreads, and for
    shot noise P(Poi(mu) < Q) <= exp(-mu) (e mu / Q)^Q (Chernoff) over all cycles below 1e-6."""
    q = scene.threshold
    mu = np.maximum(np.asarray(scene.darkest, np.float64) / scene.slack, 1e-300)
    tail = -mu + q * (1 + np.log(mu / q)) + np.log(scene.cycles)
    clear = mu >= q * (1 + _CLEAR * scene.spread)
    return np.asarray(clear & ((scene.spread == 0) | ((mu > q) & (tail < np.log(1e-6)))))


def clipped(scene: Summary) -> npt.NDArray[np.bool_]:
    """Where some light is near or over a threshold a cycle, so that the latch holds the rate."""
    edge = scene.threshold * (1 - min(_CLEAR * scene.spread, 0.5))
    return np.asarray(np.asarray(scene.brightest) > 0.9 * edge)


def lost(scene: Summary) -> Values:
    """Spikes a cycle that share their cycle with another, at the brightest: of a stationary pixel
    with Gamma(shape) intervals the integral of their distribution over the light of a cycle,
    divided by the mean interval. shape = 1 / spread^2."""
    from scipy.special import gammainc

    mu = np.asarray(scene.brightest, np.float64) / scene.threshold
    if scene.spread == 0:
        return np.maximum(mu - 1, 0.0)
    shape = 1 / scene.spread**2
    x = mu * shape
    return np.asarray(mu * gammainc(shape, x) - gammainc(shape + 1, x))


def _share(amount: Any, scene: Summary, of: Any = None) -> Values:
    """Spikes of a window as a share of those it has: of the least in the tile, or `of` a number,
    and of the floor at least."""
    least = np.asarray(scene.darkest) / scene.threshold * scene.window if of is None else of
    base = np.maximum(least, scene.floor * scene.window)
    amount, base = np.broadcast_arrays(np.asarray(amount, np.float64), base)
    share = np.full(amount.shape, np.inf)
    np.divide(amount, base, out=share, where=base > 0)
    return np.where(amount > 0, share, 0.0)


def shifted(scene: Summary, spikes: Any) -> Values:
    """What a shift by so many spikes adds to a window's relative error where thresholds are noisy.

    The window sees other draws at its ends: sqrt(2) spread x shift while the shift is within an
    interval, its root beyond, and two independent windows at most. The latch then loses other
    spikes: of those lost in a window a share that grows with the shift in cycles.
    """
    shift = np.asarray(spikes, np.float64)
    n = np.asarray(scene.brightest, np.float64) / scene.threshold * scene.window
    # Gamma(Q) intervals of Q < 2 have no mean of 1 / interval^2: a shift counts by its power Q / 2.
    power = float(np.clip(0.5 / max(scene.spread, 1e-9) ** 2, 0.5, 1))
    ends = np.where(shift < 1, shift**power, np.sqrt(shift))
    ends = np.minimum(ends, np.sqrt(np.maximum(n, 1)))
    noise = np.sqrt(2) * scene.spread * ends
    cycles = np.minimum(2 * shift * scene.window / np.maximum(n, 1e-300), 1)
    latch = np.sqrt(2 * lost(scene) * scene.window * cycles) if scene.spread else 0.0
    # What dead time costs is taken off at the spike: one that moves over a window's end takes it
    # along.
    cost = np.asarray(scene.brightest, np.float64) / scene.threshold * scene.dead
    return _share(noise + latch + cost * np.sqrt(2 * np.minimum(shift, 1)), scene)


def noisy(scene: Summary, spread: float) -> Values:
    """RMS relative error of a window whose intervals lack a noise of this relative spread: of n
    intervals sqrt(n) spread, of a part of one that part; relative to at least the floor."""
    low = np.asarray(scene.darkest, np.float64) / scene.threshold * scene.window
    high = np.asarray(scene.brightest, np.float64) / scene.threshold * scene.window
    # A window of n intervals has a variance of n spread^2, one within an interval n^2 spread^2, so
    # over the tile the mean square is at most mean(n) min(high, 1) spread^2; relative to the mean
    # or the floor that is most where the mean is the floor.
    mean = np.clip(scene.floor * scene.window, low, high)
    return _share(spread * np.sqrt(np.minimum(high, 1) * mean), scene, mean)


def contrast(scene: Summary) -> Values:
    """RMS of the light over its mean (or the floor), at most, for any light in the interval."""
    low = np.asarray(scene.darkest, np.float64)
    high = np.asarray(scene.brightest, np.float64)
    worst = np.full(np.broadcast(low, high).shape, np.inf)
    np.divide(low + high, 2 * np.sqrt(low * high), out=worst, where=low > 0)
    return np.minimum(worst, scene.relative(high))


def bound_of(scene: Summary, value: Any, proof: bool, held: bool = True) -> Bound:
    """The bound of an effect that changes a window's rate by `value`.

    Near saturation a fraction may wrap round, which adds one spike of the window.

    Args:
        scene: that is planned.
        value: relative change of the rate, a number or one a tile.
        proof: whether `value` is proven for a pixel without noise and dead time, whose rate is
            smooth in its charge; with either the bound is an estimate.
        held: whether pixels that fire in every cycle do so with and without the effect, so that
            the bound is 0 there.
    """
    value = np.asarray(value, np.float64)
    value = value + np.where(clipped(scene) & (value > 0), _share(1.0, scene), 0.0)
    if held:
        value = np.where(saturated(scene), 0.0, value)
    smooth = scene.spread == 0 and scene.dead == 0
    return Bound(value, "proof" if proof and smooth else "estimate")
