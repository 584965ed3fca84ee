"""The plan of an imager's run: which effects its light and exposures need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim import seconds_to_ps
from cosim.plan.planner import Plan, make_plan
from rtl_model.imagers.interface.model import ExposureRange, ImagerModel
from rtl_model.imagers.interface.view import View
from sensor.imagers import ImagerSummary, PixelModel

__all__ = ["PlannedRun", "RunSpec", "plan_effects", "plan_run"]


@dataclass(frozen=True)
class RunSpec:
    """What a scenario asks of a run.

    Attributes:
        name: short name of the scenario.
        title: of the scenario.
        kind: name of the imager in the catalogue.
        seconds: duration, s.
        tolerance: of the error, relative.
        seed: of all temporal noise.
        toml: the resolved scenario.
    """

    name: str
    title: str
    kind: str
    seconds: float
    tolerance: float
    seed: int
    toml: str

    @property
    def stop(self) -> int:
        """End of the run, ps."""
        return seconds_to_ps(self.seconds)


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """A run that has been checked and planned.

    Attributes:
        spec: what the scenario asks for.
        model: the imager.
        view: the light on its plane.
        exposures: what the run may meet.
        summary: what the effects' bounds have read.
        plan: what is kept.
        pixels: physics of the imager when it is switched on.
    """

    spec: RunSpec
    model: ImagerModel
    view: View
    exposures: ExposureRange
    summary: ImagerSummary
    plan: Plan
    pixels: PixelModel

    @property
    def kept(self) -> frozenset[str]:
        return frozenset(self.plan.everywhere)

    def keep(self, effects: Sequence[str]) -> PlannedRun:
        """The same run planned anew, with these effects kept."""
        plan, summary = plan_effects(
            self.model.settings(self.pixels), self.exposures, self.spec.tolerance,
            self.view.certain, effects,
        )  # fmt: skip
        return replace(self, plan=plan, summary=summary)


def plan_effects(
    settings: Sequence[PixelModel], exposures: ExposureRange, tolerance: float, certain: bool,
    forced: Sequence[str] = (),
) -> tuple[Plan, ImagerSummary]:  # fmt: skip
    """The plan of a run whose pixels work in several settings, over the whole plane and run: what
    one setting needs is kept in all. The bound of an effect is that of the setting in which it is
    largest.

    Args:
        settings: the pixels in every setting.
        exposures: what the run may meet.
        tolerance: of the error.
        certain: whether the limits of the light are proven.
        forced: effects that are kept in any case.
    """
    need = set(forced)
    plans: list[tuple[Plan, ImagerSummary]] = []
    for _ in range(2):  # what the others need is known the second time
        plans = []
        for pixels in settings:
            summary = pixels.summary(exposures.lux_seconds, exposures.seconds, exposures.frames)
            plan = make_plan(
                list(pixels.effects.values()), summary, tolerance, certain=np.array([certain]),
                forced=sorted(need),
            )  # fmt: skip
            plans.append((plan, summary))
        need |= {name for plan, _ in plans for name in plan.everywhere}
        if len(settings) == 1:
            break
    plan, summary = max(plans, key=lambda each: float(each[0].total.max()))
    rows = tuple(max(same, key=lambda row: row.bound)
                 for same in zip(*(p.rows for p, _ in plans), strict=True))  # fmt: skip
    return replace(plan, rows=rows), summary


def plan_run(spec: RunSpec, model: ImagerModel, view: View) -> PlannedRun:
    """Raises InputError for a run that cannot be made."""
    pixels = model.make().pixels  # refuses what the imager cannot do, before anything is foreseen
    exposures = model.exposures(view, spec.stop)
    plan, summary = plan_effects(model.settings(pixels), exposures, spec.tolerance, view.certain)
    return PlannedRun(spec, model, view, exposures, summary, plan, pixels)
