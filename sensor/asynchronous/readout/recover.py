"""Patches of known light: what an asynchronous camera recovers of each, and over what range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.light.source import Target
from cosim.run.result import Metric
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.readout.estimate import Observed, RateEstimate, estimate_rate, mean_rate
from sensor.dynamic_range import decibels, spike_dynamic_range

__all__ = ["WITHIN", "Recovered", "dynamic_range", "formula", "recover", "unheard"]

WITHIN = 0.2
"""A patch is recovered when its estimate is within this of the truth, and so is every brighter
one's: a lucky guess further down does not count."""


@dataclass(frozen=True, eq=False)
class Recovered:
    """One patch. lux: true, on the pixels. estimate, low, high: lux by maximum likelihood with its
    99.9 % confidence, None where its pixels gathered nothing that tells (low or high, where known,
    still bounds it). plain: lux by the mean of Q/width, None where no pixel said anything. fired,
    read, silent: pixels by what they said first; all of them are `pixels`."""

    target: Target
    lux: float
    pixels: int
    fired: int
    read: int
    silent: int
    lost: int
    estimate: float | None
    low: float | None
    high: float | None
    plain: float | None

    @property
    def error(self) -> float | None:
        """Relative, signed."""
        return None if self.estimate is None else self.estimate / self.lux - 1

    @property
    def good(self) -> bool:
        return self.error is not None and abs(self.error) <= WITHIN


def recover(
    targets: list[Target],
    firings: Firings,
    spoke: npt.NDArray[np.bool_],
    model: EventModel,
    stop: int,
    gain: float,
    per_lux: float,
    dark: float,
) -> list[Recovered]:
    """Every patch, brightest first. firings: those that crossed the channel. spoke: (pixels,) who
    fired or was read at all. stop: end of the run, ps. gain: lux on the pixel for one on the scene.
    per_lux: electrons a second for a lux on the pixel. dark: mean dark current, electrons a second,
    which is subtracted.

    Only intervals that began with the run count: that their first tick is known makes a tick's
    probability exact, and what a pixel sends later it has chosen to send. A pixel that spoke and
    whose first interval did not cross is left out.
    """
    first = firings.take(latched(firings.instant, model.tick) + 1 == firings.width)
    found = []
    for target in sorted(targets, key=lambda p: -p.lux):
        mine = first.take(target.mask.ravel()[first.pixel])
        full = mine.level == model.levels
        mask = target.mask.ravel()
        pixels, lost = int(mask.sum()), int((mask & spoke).sum()) - len(mine)
        silent = pixels - len(mine) - lost
        seen = Observed(mine.width[full], mine.level[~full].astype(np.int64), silent, stop)
        # Without a pixel that was heard or was silent, everything is unknown.
        rate = estimate_rate(model, seen) if len(seen) else RateEstimate(0.0, 0.0, math.inf)
        known = 0 < rate.rate < math.inf
        plain = mean_rate(model, seen)
        found.append(
            Recovered(
                target,
                target.lux * gain,
                pixels,
                int(full.sum()),
                int((~full).sum()),
                silent,
                lost,
                (rate.rate - dark) / per_lux if known else None,
                (rate.low - dark) / per_lux if rate.low > 0 else None,
                (rate.high - dark) / per_lux if rate.high < math.inf else None,
                (plain - dark) / per_lux if math.isfinite(plain) else None,
            )
        )
    return found


def unheard(found: list[Recovered]) -> list[str]:
    """What a user must know of pixels whose first events did not cross the channel."""
    lost, pixels = sum(p.lost for p in found), sum(p.pixels for p in found)
    if not lost:
        return []
    return [
        f"{lost} of {pixels} pixels of patches are left out of the estimates: their first events "
        "were lost or not yet carried"
    ]


def formula(model: EventModel, stop: int) -> float:
    """The paper's dynamic range, dB: 20 lg(longest / shortest x N), sections 4.4 and 4.5. Without a
    longest width the run's end is it."""
    return spike_dynamic_range(model.longest or stop, model.shortest, model.levels)


def dynamic_range(found: list[Recovered], model: EventModel, stop: int) -> dict[str, Metric]:
    """From the brightest patch down to the dimmest, as long as they are recovered. All null where
    even the brightest is not."""
    good = []
    for one in found:
        if not one.good:
            break
        good.append(one)
    top, low = (good[0], good[-1]) if good else (None, None)
    truth = seen = None
    if top is not None and low is not None and top.estimate and low.estimate:
        truth = decibels(top.lux / low.lux)
        seen = decibels(top.estimate / low.estimate)
    return {
        "dynamic_range": Metric(truth, "dB"),
        "dynamic_range_recovered": Metric(seen, "dB"),
        "dynamic_range_formula": Metric(formula(model, stop), "dB"),
        "brightest": Metric(top.lux if top else None, "lux"),
        "brightest_error": Metric(top.error if top else None, "1"),
        "dimmest": Metric(low.lux if low else None, "lux"),
        "dimmest_error": Metric(low.error if low else None, "1"),
        "patches_recovered": Metric(float(len(good)), "1"),
        "events_of_patches_unheard": Metric(float(sum(p.lost for p in found)), "1"),
    }
