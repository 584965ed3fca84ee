"""The bound of a change of light that follows from a change of an observer's weights, and the costs
of a display's effects.

A bound rests on the light of a tile on a panel: its fluctuation and its changes over its mean.
Light is in packets Q a cycle, so its mean is the spike rate r. The latch delays spikes to clock
edges, and noise of relative spread s shifts them. Times are in planes (cycles).

Costs, ns per pixel and plane, set the order in which the planner leaves effects out. Measured with
the GL renderer on two cores (llvmpipe, 1000 x 1000): one draw for each plane 336 planes/s, spans of
8 planes 9.4 k, of 64 planes 12 k. As in `sensor/latched/effects/effect.py`, the costs are constants
and are not measured on the current machine.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from display.drives import Drive
from display.effects.weights import Change, steps
from display.observe.views import Observer
from display.panels.panel import SpikePanel

Values = npt.NDArray[np.float64]
_PLANES_A_SECOND: Final = {1: 336.0, 8: 9.4e3, 64: 12.0e3}
_PIXELS: Final = 1e6
BASE_COST: Final = 1e9 / (_PLANES_A_SECOND[64] * _PIXELS)
"""Cost of spans of 64 planes."""
SPAN_COST: Final = {n: 1e9 / (rate * _PIXELS) - BASE_COST for n, rate in _PLANES_A_SECOND.items()}
"""Additional cost of shorter spans, by their number of planes."""
ROWS: Final = 0.005
"""Cost of weights for each row (assumed): a multiplication and an addition for each span."""
EMISSION: Final = 0.1
"""Cost of an emitter level that relaxes in every plane (assumed): similar to the exact hold."""
_RATES: Final = 9
"""Number of rates within the range of a tile for which an estimate is evaluated."""
_LONGEST: Final = 4.0
"""Excess of the longest interval over the mean, in relative spreads."""
JUMP: Final = math.sqrt(1 / 6 * 8 / 15)
"""Factor on equation (3), which holds for a step over the whole range at the worst moment: for
light that steps once in a span, at a random moment, between uniformly distributed levels. The
difference of two such levels is sqrt(1/6) of the range (RMS); the sum up to the moment x of a span
with linearly rising weights is proportional to 4 x (1 - x), RMS sqrt(8/15)."""


def promise(
    scene: Summary, panel: SpikePanel, observer: Observer, change: Change, reach: float
) -> Bound:
    """The bound of a change of weights, relative to the mean light of a tile or the floor: the
    proven bound if it does not exceed the weighted estimate, else the estimate.

    Args:
        scene: survey of the scene.
        panel, observer: the panel and its observer.
        change: change of the weights.
        reach: see `estimated`.
    """
    sure = proven(scene, panel, observer, change)
    likely = estimated(scene, panel, change, reach)
    if np.max(sure) <= ESTIMATE_WEIGHT * np.max(likely):
        return Bound(sure, "proof")
    return Bound(np.minimum(likely, sure / ESTIMATE_WEIGHT), "estimate")


def proven(scene: Summary, panel: SpikePanel, observer: Observer, change: Change) -> Values:
    """Proven bound of the relative change, (tiles,): equation (1) and `travel`, over the least
    mean.

    The light of a plane is between 0 and a packet, or 1 / pulse if the emitter decays slowly. The
    least mean is the floor. For packets without noise and without emitter time constants, it is the
    rate r of the darkest pixel, less the effect of the phases of its spikes: by summation by parts,
    sum w_n (L_n - r) is less than the variation of the weights, because the number of spikes
    differs from r t by less than one.
    """
    top = 1 / panel.share if panel.decay > 0 else 1.0
    loss = 2 * steps(observer, panel, scene.cycles).half
    plain = panel.packets and panel.rise == panel.decay == 0
    # A pixel that loses light at the ends of the run has less light than its rate.
    loss = loss + change.lost if plain else math.inf
    return np.asarray((change.half + change.travel) * top / base(scene, loss))


def estimated(scene: Summary, panel: SpikePanel, change: Change, reach: float) -> Values:
    """Estimate of the relative change, (tiles,). It is the sum of these parts:

    - Random fluctuation from plane to plane (`root`).
    - Motion: a step over the range of the tile once in every span (`spans`, JUMP), and a shift on
      the retina (`travel` times the difference of neighbours, at most twice the amplitude), with
      the fluctuation of the shifted light.
    - The first light of a hold (`jump`), at different times in neighbouring pixels.
    - Weight beyond the run, which removes steady light (`lost`).

    Args:
        scene: survey of the scene.
        panel: the panel.
        change: change of the weights.
        reach: number of planes within which the changed weights change their sign.
    """
    contrast = spread(scene)
    moving = np.asarray(scene.planes) > 0
    likely = change.root * fluctuation(scene, panel.scheme, reach)
    likely = likely + JUMP * 2 * change.spans * contrast * moving
    likely = likely + 2 * change.travel * contrast + change.lost * (1 + contrast)
    likely = likely + np.sqrt(2) * change.travelled * fluctuation(scene, panel.scheme, np.inf)
    if not panel.packets:  # dark before the first or second spike
        unlit, planes = dark_rate(scene, change.unseen, panel.scheme.spikes)
        apart = np.minimum(change.travel, change.travelled * np.sqrt(planes))
        likely = likely + unlit * (change.jump + apart)
    return np.asarray(likely)


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
