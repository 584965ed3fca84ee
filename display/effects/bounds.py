"""A bound from a change of an observer's weights."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from display.effects.statistics import base, flutter, spread, unlit_rate
from display.effects.weights import Change, steps
from display.observe.views import Observer
from display.panels.panel import SpikePanel

__all__ = ["JUMP", "estimated", "promise", "proven"]

JUMP: Final = math.sqrt(1 / 6 * 8 / 15)
"""Of (3) for light that goes all the way at the worst moment: of light that jumps once in a span,
at any moment, between levels drawn evenly. Two such levels are sqrt(1/6) of the range apart (RMS);
what is summed up to moment x of a span of evenly rising weights goes as 4 x (1 - x), RMS
sqrt(8/15)."""
Values = npt.NDArray[np.float64]


def proven(scene: Summary, panel: SpikePanel, observer: Observer, change: Change) -> Values:
    """(tiles,) that no light of this panel exceeds: (1) and `travel` over the least mean.

    A plane's light is from 0 to a packet, or to 1 / pulse where the emitter's decay lets it glow
    on. The mean is the floor; with packets, no noise and no emitter it is the darkest pixel's rate
    r less what the phases of its spikes take off: sum w_n (L_n - r) is, summed by parts, less than
    the variation of the weights, as the spikes are less than one off r t.
    """
    top = 1 / panel.share if panel.decay > 0 else 1.0
    loss = 2 * steps(observer, panel, scene.cycles).half
    plain = panel.packets and panel.rise == panel.decay == 0
    # A pixel whose light is lost at the run's ends has less than its rate.
    loss = loss + change.lost if plain else math.inf
    return np.asarray((change.half + change.travel) * top / base(scene, loss))


def estimated(scene: Summary, panel: SpikePanel, change: Change, reach: float) -> Values:
    """(tiles,) the right size: what flutters does so by chance (root); what moves jumps between the
    tile's ends once in every span (spans, JUMP), or is off by a place (travel times the difference
    of neighbours, at most twice the amplitude) and by flutter of its own. A hold lights up once
    (jump), neighbours at other times. Weight that is lost takes steady light with it. reach: planes
    within which changed weights turn.
    """
    contrast = spread(scene)
    moving = np.asarray(scene.planes) > 0
    likely = change.root * flutter(scene, panel.scheme, reach)
    likely = likely + JUMP * 2 * change.spans * contrast * moving
    likely = likely + 2 * change.travel * contrast + change.lost * (1 + contrast)
    likely = likely + np.sqrt(2) * change.travelled * flutter(scene, panel.scheme, np.inf)
    if not panel.packets:  # dark up to the first or second spike
        unlit, planes = unlit_rate(scene, change.unseen, panel.scheme.spikes)
        apart = np.minimum(change.travel, change.travelled * np.sqrt(planes))
        likely = likely + unlit * (change.jump + apart)
    return np.asarray(likely)


def promise(
    scene: Summary, panel: SpikePanel, observer: Observer, change: Change, reach: float
) -> Bound:
    """What a change of weights changes, relative to the tile's mean light or the floor: the proof
    where it is not above the estimate as that counts, else the estimate."""
    sure = proven(scene, panel, observer, change)
    likely = estimated(scene, panel, change, reach)
    if np.max(sure) <= ESTIMATE_WEIGHT * np.max(likely):
        return Bound(sure, "proof")
    return Bound(np.minimum(likely, sure / ESTIMATE_WEIGHT), "estimate")
