"""The plan of an imager's run: which effects its light and exposures need, and the forecast of
`viform plan`, with the run time predicted from the cost table of the effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from cosim import seconds_to_ps
from cosim.plan.planner import Plan, make_plan
from cosim.plan.study import Speeds, forecast_document
from imagers.common.model import ExposureRange, ImagerModel, View
from sensor.frame_pixels import ImagerSummary, PixelModel


@dataclass(frozen=True)
class RunSpec:
    """The requirements of a scenario for a run.

    Attributes:
        name: short name of the scenario.
        title: title of the scenario.
        kind: name of the imager in the catalogue.
        seconds: duration, s.
        tolerance: largest relative error.
        seed: seed of all temporal noise.
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
        spec: requirements of the scenario.
        model: the imager with its settings.
        view: the light on its plane.
        exposures: limits of the exposures.
        summary: light and exposures as the bounds of the effects read them.
        plan: the effects that are kept and omitted.
        pixels: physics of the imager at power-on.
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
    """The plan for the whole plane and run. An effect that one setting of the pixels needs is kept
    in all settings. The bound of an effect is its largest bound in any setting.

    Args:
        settings: the pixels in every setting of the run.
        exposures: limits of the exposures.
        tolerance: largest relative error.
        certain: whether the limits of the light are proven.
        forced: effects that are kept in any case.
    """
    need = set(forced)
    plans: list[tuple[Plan, ImagerSummary]] = []
    for _ in range(2):  # the second pass knows the effects that the other settings need
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
    largest = (max(same, key=lambda row: row.bound)
               for same in zip(*(p.rows for p, _ in plans), strict=True))  # fmt: skip
    rows = tuple(replace(row, kept=own.kept) for row, own in zip(largest, plan.rows, strict=True))
    return replace(plan, rows=rows), summary


def plan_run(spec: RunSpec, model: ImagerModel, view: View) -> PlannedRun:
    """Checks and plans a run. Raises InputError for a run that is not possible."""
    pixels = model.make().pixels  # first, because it refuses impossible settings
    exposures = model.exposures(view, spec.stop)
    plan, summary = plan_effects(model.settings(pixels), exposures, spec.tolerance, view.certain)
    return PlannedRun(spec, model, view, exposures, summary, plan, pixels)


DEVICE: Final = "numba on this processor"


def forecast(run: PlannedRun) -> dict[str, Any]:
    """The document of `viform plan --json`. Nothing is simulated."""
    plan, exposures, (rows, columns) = run.plan, run.exposures, run.model.shape
    return forecast_document(
        run.spec.name, plan, tier="exact", device=DEVICE, tier_error=0.0,
        speeds=Speeds(plan.cost_ns, plan.full_ns, plan.full_ns, None),
        pixel_cycles=rows * columns * exposures.frames,
        imager=run.spec.kind,
        expected={
            "frames": exposures.frames,
            "lux_seconds": list(exposures.lux_seconds),
            "exposure_s": list(exposures.seconds),
            "photoelectrons": [float(run.summary.darkest), float(run.summary.brightest)],
        },
    )  # fmt: skip
