"""Error of the rate in a window of a pixel's spikes, as the bounds of effects use it.

A rate counts latched bits plus the change of stored charge over the threshold of its interval, so
it is smooth in the accumulated charge. Three errors change it: an error of the charge; threshold
noise, as shifted spikes bring other draws into the window; and the latch, which counts two spikes
in one cycle as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Summary
from cosim.plan.tiles import TILE

Values = npt.NDArray[np.float64]
CHANCE = 1e-4
"""Chance that a scene has a tile with more changed spikes than a bound takes."""
SHARES = tuple(4.0**-n for n in range(5))
"""Shares of the pixels of a tile that have its brightest light, from all to one of 256."""
GAINS = 5.0
"""Standard deviations within which the gains of pixels lie."""
_SCORES = 81
"""Gains of pixels within that range over which the lost spikes are averaged."""
_TABLED = 4096
"""Mean numbers of events up to which the exceeded number is read from a table."""
_CLEAR = 8.0
"""Standard deviations by which light exceeds the threshold of a pixel that fires in every cycle."""


def saturated_tiles(scene: Summary) -> npt.NDArray[np.bool_]:
    """Tiles in which every pixel fires in every cycle, whatever the noise: light exceeds the
    threshold by _CLEAR standard deviations, and with shot noise the Chernoff bound P(Poi(mu) < Q)
    <= exp(-mu) (e mu / Q)^Q over all cycles is below 1e-6."""
    q = scene.threshold
    mu = np.maximum(np.asarray(scene.darkest, np.float64) / scene.slack, 1e-300)
    tail = -mu + q * (1 + np.log(mu / q)) + np.log(scene.cycles)
    clear = mu >= q * (1 + _CLEAR * scene.spread)
    return np.asarray(clear & ((scene.spread == 0) | ((mu > q) & (tail < np.log(1e-6)))))


def clipped_tiles(scene: Summary) -> npt.NDArray[np.bool_]:
    """Tiles with light near or above one threshold a cycle, where the latch limits the rate."""
    edge = scene.threshold * (1 - min(_CLEAR * scene.spread, 0.5))
    return np.asarray(np.asarray(scene.brightest) > 0.9 * edge)


def lost_spikes(scene: Summary) -> Values:
    """Spikes a cycle that are lost because another spike falls in the same cycle, at the
    brightest, (tiles,)."""
    return _lost_at(np.asarray(scene.brightest, np.float64) / scene.threshold, scene.spread)


def _lost_at(mu: Values, spread: float) -> Values:
    """Spikes a cycle that are lost where `mu` thresholds fall on a pixel in a cycle.

    For a stationary pixel with Gamma(shape) intervals, shape = 1 / spread^2, this is the integral
    of their distribution over the light of a cycle, divided by the mean interval.
    """
    from scipy.special import gammainc

    if spread == 0:
        return np.maximum(mu - 1, 0.0)
    shape = 1 / spread**2
    x = mu * shape
    return np.asarray(mu * gammainc(shape, x) - gammainc(shape + 1, x))


@lru_cache(maxsize=8)
def _means(chance: float) -> Values:
    """Mean of the Poisson distribution that exceeds 0, 1, 2, ... with this chance, for numbers up
    to that of a mean of _TABLED: P(N <= n) = gammaincc(n + 1, mean)."""
    from scipy.special import gammainccinv

    most = _TABLED + 12 * int(np.sqrt(_TABLED))
    return np.asarray(gammainccinv(np.arange(1, most + 1), 1 - chance))


def _exceeded(mean: Values, chance: float) -> Values:
    """Least number that a Poisson variate of this mean exceeds with at most this chance, (n,)."""
    from scipy.special import pdtrik

    number = np.searchsorted(_means(chance), mean).astype(np.float64)
    large = mean > _TABLED
    number[large] = np.ceil(pdtrik(1 - chance, mean[large]))
    return number


def rare_error(
    scene: Summary, events: Any, size: Any = 1.0, shares: Sequence[float] = SHARES,
    chance: Values | None = None,
) -> Values:  # fmt: skip
    """Relative error of a tile some of whose brightest pixels have a rare event, such as a spike
    more or less in the window.

    Such pixels are few, and a tile may have several where most tiles have none. Their number in a
    tile is Poisson distributed; it exceeds the number that is taken here in CHANCE of all scenes,
    in any of their tiles. A share of the pixels has the brightest light, and the others the
    darkest; the error is that of the worst share.

    Args:
        scene: summary of the scene.
        events: expected number of events of a pixel; a number, or one a tile.
        size: change of a pixel by one event, spikes; a number, or one a tile.
        shares: the shares of the pixels that are tried.
        chance: (tiles,) with which the number in a tile may exceed that which is taken; None for an
            equal part of CHANCE.
    """
    low, high = (np.asarray(x, np.float64) / scene.threshold for x in (
        scene.darkest, scene.brightest
    ))  # fmt: skip
    tiles = np.broadcast(low, high)
    if chance is None:
        chance = np.full(tiles.shape, CHANCE / tiles.size)
    worst, chances = np.zeros(tiles.shape), np.unique(chance)
    for share in shares:
        mean = np.asarray(events, np.float64) * share * TILE**2
        most = np.zeros(tiles.shape)
        for each in chances:
            some = chance == each
            most[some] = _exceeded(np.broadcast_to(mean, tiles.shape)[some], float(each))
        changed = size * np.sqrt(most) / TILE
        light = low + share * (np.minimum(high, 1) - np.minimum(low, 1))
        worst = np.maximum(worst, share_of_window(changed, scene, light * scene.window))
    return worst


def share_of_window(amount: Any, scene: Summary, total: Any = None) -> Values:
    """A number of spikes relative to the spikes of a window.

    Args:
        amount: spikes.
        scene: summary of the scene.
        total: spikes of the window, by default the fewest in the tile; at least the floor's.
    """
    if total is None:
        total = np.asarray(scene.darkest) / scene.threshold * scene.window
    base = np.maximum(total, scene.floor * scene.window)
    amount, base = np.broadcast_arrays(np.asarray(amount, np.float64), base)
    share = np.full(amount.shape, np.inf)
    np.divide(amount, base, out=share, where=base > 0)
    return np.where(amount > 0, share, 0.0)


def shift_error(scene: Summary, spikes: Any) -> Values:
    """Relative error of a window whose spikes are shifted against their noisy thresholds.

    Args:
        scene: summary of the scene.
        spikes: the shift, in spikes; a number, or one a tile.
    """
    rare = crossing_error(scene, spikes) + latch_error(scene, spikes)
    return ends_error(scene, spikes) + rare


def ends_error(scene: Summary, spikes: Any) -> Values:
    """The part of `shift_error` at the ends of the window, which contains other draws there.

    The error is sqrt(2) spread x shift for shifts within an interval, grows with the root of the
    shift beyond, and is at most that of two independent windows.
    """
    shift = np.asarray(spikes, np.float64)
    light = np.asarray(scene.brightest, np.float64) / scene.threshold
    # For Q < 2 the mean of 1 / interval^2 of Gamma(Q) diverges: the shift counts to the power Q /
    # 2.
    power = float(np.clip(0.5 / max(scene.spread, 1e-9) ** 2, 0.5, 1))
    ends = np.where(shift < 1, shift**power, np.sqrt(shift))
    ends = np.minimum(ends, np.sqrt(np.maximum(light * scene.window, 1)))
    return share_of_window(np.sqrt(2) * scene.spread * ends, scene)


def crossing_error(scene: Summary, spikes: Any, chance: Values | None = None) -> Values:
    """The part of `shift_error` from spikes that move over an end of the window.

    The light lost in dead time counts at the spike, and moves with it. Such spikes are rare.

    Args:
        scene: summary of the scene.
        spikes: the shift, in spikes; a number, or one a tile.
        chance: see `rare_error`.
    """
    if scene.dead == 0:
        return np.zeros(np.broadcast(scene.darkest, scene.brightest).shape)
    light = np.asarray(scene.brightest, np.float64) / scene.threshold
    return rare_error(scene, 2 * np.minimum(spikes, 1), light * scene.dead, chance=chance)


def latch_error(scene: Summary, spikes: Any, chance: Values | None = None) -> Values:
    """The part of `shift_error` from the latch, which loses other spikes if they are shifted.

    A share of the lost spikes changes, which grows with the shift in cycles. A moved spike changes
    the count only next to an empty cycle. Above one threshold a cycle empty cycles are rarer than
    lost spikes, so most changes occur at one. They are rare (`rare_error`). Gains of pixels spread
    the light of a tile further. Without noise, light above one threshold a cycle loses a spike each
    time its excess adds up to one, and a shift moves one such loss over each end of the window.
    spikes, chance: see `crossing_error`.
    """
    low, high = (np.asarray(x, np.float64) / scene.threshold for x in (
        scene.darkest, scene.brightest
    ))  # fmt: skip
    if scene.spread == 0:
        reached = high * (1 + GAINS * scene.uneven) > 1
        moved = np.where(reached, 2 * np.minimum(spikes, 1), 0.0)
        return rare_error(scene, moved, chance=chance)
    cycles = np.minimum(2 * np.asarray(spikes, np.float64) / np.maximum(high, 1e-300), 1)
    likely = np.minimum(np.maximum(low, 1.0), high)
    lost = _lost_or_won(likely.tobytes(), scene.spread, scene.uneven).reshape(likely.shape)
    return rare_error(scene, 2 * lost * scene.window * cycles, chance=chance)


@lru_cache(maxsize=4)  # several effects of a scene ask for the same
def _lost_or_won(light: bytes, spread: float, uneven: float) -> Values:
    """Cycles with a lost spike, or those without a spike if they are rarer, a cycle: mean over
    pixels whose gains have the relative standard deviation `uneven`. light: thresholds a cycle,
    (n,) float64."""
    score = np.linspace(-GAINS, GAINS, _SCORES) if uneven else np.zeros(1)
    weight = np.exp(-score * score / 2)
    mean = np.frombuffer(light)
    lost = np.zeros(mean.shape)
    for gain, share in zip(1 + uneven * score, weight / weight.sum(), strict=True):
        mu = np.maximum(mean * gain, 0.0)
        shared = _lost_at(mu, spread)
        lost = lost + share * np.minimum(shared, np.maximum(1 - mu + shared, 0))
    return lost


def noise_error(scene: Summary, spread: float) -> Values:
    """RMS relative error of a window whose intervals lack a noise of this relative spread.

    It is sqrt(n) spread for n intervals, and n spread for a part n of one, relative to n or the
    floor.
    """
    low = np.asarray(scene.darkest, np.float64) / scene.threshold * scene.window
    high = np.asarray(scene.brightest, np.float64) / scene.threshold * scene.window
    # The variance is n spread^2 for n intervals, and n^2 spread^2 within an interval. Over the tile
    # the mean square is therefore at most mean(n) min(high, 1) spread^2. Relative to the mean or
    # the floor it is largest where the mean equals the floor.
    mean = np.clip(scene.floor * scene.window, low, high)
    return share_of_window(spread * np.sqrt(np.minimum(high, 1) * mean), scene, mean)


def light_contrast(scene: Summary) -> Values:
    """Upper limit of RMS over mean (or floor) of the light, for any light within its range."""
    low = np.asarray(scene.darkest, np.float64)
    high = np.asarray(scene.brightest, np.float64)
    worst = np.full(np.broadcast(low, high).shape, np.inf)
    np.divide(low + high, 2 * np.sqrt(low * high), out=worst, where=low > 0)
    return np.minimum(worst, scene.relative(high))


def bound_of(scene: Summary, value: Any, proof: bool, held: bool = True) -> Bound:
    """The bound of an effect that changes the rate of a window by `value`.

    Near saturation the fraction may wrap around, which adds one spike of the window.

    Args:
        scene: summary of the scene.
        value: relative change of the rate, a number or one a tile.
        proof: whether `value` is proven for a pixel without noise and dead time, whose rate is
            smooth in its charge. With noise or dead time the bound is an estimate.
        held: whether saturated pixels fire in every cycle with and without the effect, so that
            their bound is 0.
    """
    value = np.asarray(value, np.float64)
    value = value + np.where(clipped_tiles(scene) & (value > 0), share_of_window(1.0, scene), 0.0)
    if held:
        value = np.where(saturated_tiles(scene), 0.0, value)
    smooth = scene.spread == 0 and scene.dead == 0
    return Bound(value, "proof" if proof and smooth else "estimate")
