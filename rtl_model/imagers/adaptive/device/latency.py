"""How long a change of light takes to be seen with its new exposure, measured on the sensor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cosim.clock import PS
from rtl_model.imagers.adaptive.device.decision import Search
from rtl_model.imagers.adaptive.device.imager import AdaptiveExposure
from rtl_model.imagers.adaptive.device.timing import Timing
from sensor.imagers import Course, Still
from sensor.imagers.cmos import AdaptivePixels

__all__ = ["Latency", "latency"]


class Latency(NamedTuple):
    """changed: the last frame any of whose rows still saw light from before the change (N).
    recorded: the first later frame with another exposure than before. settled: the first frame from
    which exposure changes no more. seconds: from the change to row 0's sample of `settled`."""

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
    """Light on all pixels goes from `before` to `after` lux at `change` ps; pixels without noise.

    multiplier: that rests under `before`, set by the user until the sensor is automatic with its
    first decision. frames: to look at after the change. RuntimeError where nothing changes.
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
    made = list(imager.film(Still(plane, course), until, seed=0, kept=frozenset()))
    changed = max((f.number for f in made if f.begin[0] < change), default=0)
    steps = [f.state["multiplier"] for f in made]
    if steps[0] != multiplier or steps[-1] == steps[changed]:
        raise RuntimeError(f"the exposure does not change: {steps}")
    recorded = next(n for n in range(changed, len(steps)) if steps[n] != multiplier)
    last = max(n for n in range(1, len(steps)) if steps[n] != steps[n - 1])
    return Latency(changed, recorded, last, (int(made[last].end[0]) - change) / PS)
