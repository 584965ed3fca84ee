"""Targets of known light: what an asynchronous camera recovers of each, and its dynamic range."""

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
"""Relative error up to which a target counts as recovered, if every brighter one does."""


@dataclass(frozen=True, eq=False)
class Recovered:
    """One target.

    Attributes:
        target: in the scene.
        lux: true illuminance on the pixels.
        pixels: number of its pixels, the sum of `fired`, `read`, `silent` and `lost`.
        fired, read, silent: pixels by their first report: a spike, a reading, none.
        lost: pixels whose first event did not cross the channel.
        estimate, low, high: lux by maximum likelihood, with limits of 99.9 % confidence; None if
            the pixels gathered too little. A limit that is known still bounds the light.
        plain: lux by the mean of Q/width; None without a report.
    """

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
    fired: npt.NDArray[np.bool_],
    model: EventModel,
    stop: int,
    gain: float,
    per_lux: float,
    dark: float,
) -> list[Recovered]:
    """Estimates the light of every target, the brightest first.

    Only intervals that began with the run count: their first tick is known, which makes the
    probability of a tick exact, and later reports are a biased choice. A pixel that fired and whose
    first interval did not cross the channel is left out.

    Args:
        targets: in the scene.
        firings: that crossed the channel.
        fired: whether a pixel has fired or was read at all, (pixels,).
        model: rules of a pixel.
        stop: end of the run, ps.
        gain: lux on the pixel for one on the scene.
        per_lux: photocurrent for a lux on the pixel, electrons/s.
        dark: mean dark current, electrons/s; it is subtracted.
    """
    first = firings.take(latched(firings.instant, model.tick) + 1 == firings.width)
    recovered = []
    for target in sorted(targets, key=lambda p: -p.lux):
        mine = first.take(target.mask.ravel()[first.pixel])
        full = mine.level == model.levels
        mask = target.mask.ravel()
        pixels, lost = int(mask.sum()), int((mask & fired).sum()) - len(mine)
        silent = pixels - len(mine) - lost
        seen = Observed(mine.width[full], mine.level[~full].astype(np.int64), silent, stop)
        # Without a pixel that was heard or was silent, everything is unknown.
        rate = estimate_rate(model, seen) if len(seen) else RateEstimate(0.0, 0.0, math.inf)
        known = 0 < rate.rate < math.inf
        plain = mean_rate(model, seen)
        recovered.append(
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
    return recovered


def unheard(recovered: list[Recovered]) -> list[str]:
    """What a user must know of pixels whose first events did not cross the channel."""
    lost, pixels = sum(p.lost for p in recovered), sum(p.pixels for p in recovered)
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


def dynamic_range(recovered: list[Recovered], model: EventModel, stop: int) -> dict[str, Metric]:
    """From the brightest patch down to the dimmest, as long as they are recovered. All null where
    even the brightest is not."""
    good = []
    for one in recovered:
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
        "events_of_patches_unheard": Metric(float(sum(p.lost for p in recovered)), "1"),
    }
