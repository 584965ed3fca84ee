"""Targets of known light: what an asynchronous camera recovers of each, and its dynamic range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.source import Target
from cosim.run.result import Metric
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.readout.estimate import (
    Observed,
    RateEstimate,
    estimate_rate,
    mean_rate,
    single_rates,
)
from sensor.dynamic_range import decibels, spike_dynamic_range

WITHIN = 0.2
"""Relative error up to which a target counts as recovered, if every brighter one does."""
ALONE: Final = 0.683
"""Share of a target's pixels that must be within it, each by its own report alone, for a target
that single pixels recover: that of one standard deviation."""


@dataclass(frozen=True, eq=False)
class Recovered:
    """One target.

    Attributes:
        target: target in the scene.
        lux: true illuminance on the pixels.
        pixels: number of its pixels, the sum of `fired`, `read`, `silent` and `lost`.
        fired, read, silent: pixels by their first report: a spike, a reading, none.
        lost: pixels whose first event did not cross the channel.
        estimate, low, high: lux by maximum likelihood, with limits of 99.9 % confidence; None if
            the pixels gathered too little. A limit that is known still bounds the light.
        plain: lux by the mean of Q/width; None without a report.
        alone: share of the pixels whose own report gives the light within `WITHIN`.
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
    alone: float = 0.0

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
        targets: targets in the scene.
        firings: firings that crossed the channel.
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
        plain, true = mean_rate(model, seen), target.lux * gain * per_lux
        off = np.abs(single_rates(model, seen) - dark - true)
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
                int((off <= WITHIN * true).sum()) / max(pixels, 1),
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
    """Range from the brightest patch down to the dimmest, as long as they are recovered: by all
    pixels of a patch together, and (`dynamic_range_pixel`) by single pixels. All null where even
    the brightest is not."""
    good = list(takewhile(lambda one: one.good, recovered))
    single = list(takewhile(lambda one: one.alone >= ALONE, recovered))
    top, low = (good[0], good[-1]) if good else (None, None)
    truth = seen = None
    if top is not None and low is not None and top.estimate and low.estimate:
        truth = decibels(top.lux / low.lux)
        seen = decibels(top.estimate / low.estimate)
    return {
        "dynamic_range": Metric(truth, "dB", "not even the brightest patch is recovered"),
        "dynamic_range_recovered": Metric(seen, "dB", "not even the brightest patch is recovered"),
        "dynamic_range_pixel": Metric(
            decibels(single[0].lux / single[-1].lux) if single else None,
            "dB",
            "single pixels do not recover even the brightest patch",
        ),
        "dynamic_range_formula": Metric(formula(model, stop), "dB"),
        "brightest": Metric(
            top.lux if top else None, "lux", "not even the brightest patch is recovered"
        ),
        "brightest_error": Metric(
            top.error if top else None, "1", "not even the brightest patch is recovered"
        ),
        "dimmest": Metric(
            low.lux if low else None, "lux", "not even the brightest patch is recovered"
        ),
        "dimmest_error": Metric(
            low.error if low else None, "1", "not even the brightest patch is recovered"
        ),
        "patches_recovered": Metric(float(len(good)), "1"),
        "events_of_patches_unheard": Metric(float(sum(p.lost for p in recovered)), "1"),
    }
