"""The latency from a step of the light to the new exposure, measured on the simulated sensor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cosim.clock import PS
from imagers.adaptive.device.decision import Search
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.timing import Timing
from imagers.adaptive.pixels import AdaptivePixels
from imagers.common.scenery import Course, Still

__all__ = ["Latency", "latency"]


class Latency(NamedTuple):
    """Frames and time after a step of the light.

    Attributes:
        changed: last frame N with a row that was exposed before the step.
        recorded: first later frame with a new exposure.
        settled: first frame from which the exposure does not change.
        seconds: time from the step to the sample of row 0 of frame `settled`, s.
    """

    changed: int
    recorded: int
    settled: int
    seconds: float


def latency(
    timing: Timing,
    change: int,
    before: float,
    after: float,
    *,
    multiplier: int,
    search: Search = Search.PART,
    frames: int = 12,
) -> Latency:
    """Steps the light on all pixels and measures the response, without noise.

    Args:
        timing: timing of the sensor.
        change: instant of the step, ps.
        before, after: illuminance before and after it, lux.
        multiplier: settled exposure under `before`, in units of T. It is set by the user; the first
            decision is automatic.
        search: how a saturating exposure is shortened.
        frames: number of frames that are filmed after the step, at least.

    Raises RuntimeError if the exposure does not change.
    """
    pixels = AdaptivePixels((timing.rows, timing.columns))
    imager = AdaptiveExposure(pixels, timing)
    imager.write("adaptive_automatic", 0)
    imager.write("adaptive_user", multiplier)
    imager.write("adaptive_search", int(search))
    imager.write("adaptive_automatic", 1, at=1)
    plane = np.ones(pixels.shape)
    course = Course(((change, before), (change, after)))
    until = change + frames * timing.clock.edge(timing.period(multiplier * 20))
    taken = list(imager.film(Still(plane, course), until, seed=0, kept=frozenset()))
    changed = max((f.number for f in taken if f.begin[0] < change), default=0)
    steps = [f.state["multiplier"] for f in taken]
    if steps[0] != multiplier or steps[-1] == steps[changed]:
        raise RuntimeError(f"the exposure does not change: {steps}")
    recorded = next(n for n in range(changed, len(steps)) if steps[n] != multiplier)
    last = max(n for n in range(1, len(steps)) if steps[n] != steps[n - 1])
    return Latency(changed, recorded, last, (int(taken[last].end[0]) - change) / PS)
