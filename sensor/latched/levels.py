"""Bounds of a run whose registers are written: sums over its threshold levels.

Between two writes a pixel has one threshold, and each bound holds there, over the whole run. A
window of an image may meet several levels. Its error is then at most the sum of the errors of all
levels, relative to the rate of each; `widening` is the largest factor by which the rate of a level
exceeds the mean rate of a row in a window.

The charge that pixels keep is converted at a write with a rounding below those of a cycle. The
interval that runs across a write has the same random word, and so the same quantile, in all tiers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Bound, Effect, Kind, Summary
from cosim.plan.paired import Span
from sensor.latched.fast.units import units_of
from sensor.latched.setting import CameraSetting
from sensor.latched.writes import threshold_shares

Values = npt.NDArray[np.float64]


def _scene_at(level: CameraSetting, scene: Summary) -> Summary:
    """The scene for pixels at this level."""
    return replace(scene, threshold=level.threshold, spread=level.spread, slack=level.slack)


def widening(setting: CameraSetting, spans: Sequence[Span]) -> float:
    """The largest ratio of the rate of a level to the mean rate of a row that is read, over the
    windows; 1 if no window meets a write."""
    phases, height, most = setting.phases, setting.chip.height, 1.0
    for first, stop in spans:
        mean = threshold_shares(phases, setting.threshold, height, first, stop)
        ends = [phase.start for phase in phases[1:]] + [stop]
        for phase, end in zip(phases, ends, strict=True):
            if phase.start < stop and end > first:
                rows = mean[slice(*phase.window)]
                most = max(most, setting.threshold / phase.threshold / float(rows.min()))
    return most


def planned_effects(setting: CameraSetting, spans: Sequence[Span]) -> tuple[Effect, ...]:
    """The acting effects, with bounds that hold for all levels of the run."""
    if not setting.writes:
        return setting.acting_effects
    levels, wide = setting.levels, widening(setting, spans)
    found = zip(*(level.acting_effects for level in levels), strict=True)
    return tuple(_over_levels(same, levels, wide) for same in found)


def _over_levels(same: Sequence[Effect], levels: Sequence[CameraSetting], wide: float) -> Effect:
    """One effect at all levels as one."""

    def bound(scene: Summary) -> Bound:
        bounds = [e.bound(_scene_at(s, scene)) for e, s in zip(same, levels, strict=True)]
        kind: Kind = "proof" if all(each.kind == "proof" for each in bounds) else "estimate"
        return Bound(wide * sum(np.asarray(each.value, float) for each in bounds), kind)

    def cost(scene: Summary) -> Any:
        costs = [e.cost(_scene_at(s, scene)) for e, s in zip(same, levels, strict=True)]
        return np.max(np.broadcast_arrays(*costs), axis=0)

    return replace(same[0], bound=bound, cost=cost)


def error_over_levels(
    setting: CameraSetting,
    scene: Summary,
    spans: Sequence[Span],
    error: Callable[[CameraSetting, Summary], Values],
) -> Values:
    """An error of the arithmetic, (tiles,), over all levels of the run."""
    if not setting.writes:
        return error(setting, scene)
    errors = [error(level, _scene_at(level, scene)) for level in setting.levels]
    return np.asarray(widening(setting, spans) * np.sum(errors, axis=0))


def fast_can_follow(setting: CameraSetting, scene: Summary) -> bool:
    """Whether the bounds of the fast tier hold across the writes of a run.

    Charge beyond a lowered threshold needs the light of its cycle under a hard reset and a dead
    time. Where light exceeds the shortest threshold the fast tier takes thresholds off at their
    mean; at the next level it would draw others than the reference.
    """
    levels = setting.levels
    if len(levels) == 1:
        return True
    if setting.reset == "hard" or setting.dead_time > 0:
        return False
    most = float(np.max(np.asarray(scene.brightest)))
    return all(
        not level.model.noisy
        or most / level.model.mean * units_of(level.model).one < units_of(level.model).shortest
        for level in levels
    )
