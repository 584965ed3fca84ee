"""The bound of a change of light that follows from a change of an observer's weights."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from display.effects.statistics import base, dark_rate, fluctuation, spread
from display.effects.weights import Change, steps
from display.observe.views import Observer
from display.panels.panel import SpikePanel

JUMP: Final = math.sqrt(1 / 6 * 8 / 15)
"""Factor on equation (3), which holds for a step over the whole range at the worst moment: for
light that steps once in a span, at a random moment, between uniformly distributed levels. The
difference of two such levels is sqrt(1/6) of the range (RMS); the sum up to the moment x of a span
with linearly rising weights is proportional to 4 x (1 - x), RMS sqrt(8/15)."""
Values = npt.NDArray[np.float64]


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
