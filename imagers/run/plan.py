"""The plan of an imager's run, its forecast, and its error against run time.

The plan is what effects the light and the exposures of the run need. The forecast of `viform plan`
predicts the run time from the cost table of the effects. For `viform accuracy`, the imager films
the scenario once with every effect; this is the reference. On patches of chosen frames, every
distinct plan of a ladder of tolerances converts the same exposures with the same random numbers.
The time of a plan is the shortest of a few conversions of one whole frame. The decisions of the
controller are not compared; the check of a run does that (`check.decisions`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from cosim import seconds_to_ps
from cosim.plan.error import Measured
from cosim.plan.planner import Plan, make_plan
from cosim.plan.study import REFERENCE, Speeds, Step, climb, forecast_document, ladder_document
from cosim.run.progress import Progress
from cosim.run.timing import least_of
from imagers.common.model import ExposureRange, ImagerModel, View
from imagers.run.check import Patches, watched_frames
from imagers.run.tape import NoTape, Taped
from sensor.frame_pixels import Exposed, ImagerSummary, PixelModel

CALLS: Final = 4
"""Timed conversions of each plan, after one that is not timed."""
DEVICE: Final = "numba on this processor"


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


class _TimedPatches(Patches):
    """Patches that also measure the time of every plan, on the largest of the chosen frames."""

    def __init__(
        self, full: frozenset[str], ways: dict[str, frozenset[str]], seed: int, frames: list[int]
    ) -> None:
        super().__init__(full, ways, seed, frames)
        self._timed, self._noise, self._numbers = ways | {REFERENCE: full}, seed, set(frames)
        self._largest = 0
        self.nanoseconds: dict[str, float] = {}

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        super().__call__(rows, pixels)
        if rows.frame in self._numbers and rows.lux_seconds.size > self._largest:
            self._largest = rows.lux_seconds.size
            calls: list[Callable[[], Any]] = [
                partial(pixels.convert, rows, self._noise, kept) for kept in self._timed.values()
            ]
            each = [seconds * 1e9 / self._largest for seconds in least_of(calls, CALLS)]
            self.nanoseconds = dict(zip(self._timed, each, strict=True))


def measure_ladder(run: PlannedRun, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --json`."""
    effects = list(run.pixels.effects)
    full = frozenset(effects)
    settings = run.model.settings(run.pixels)
    rungs = climb(
        ["exact"],
        lambda _, tolerance: frozenset(
            plan_effects(settings, run.exposures, tolerance, run.view.certain)[0].everywhere
        ),
        lambda kept: kept,
    )
    ways = {rung.name: rung.plan for rung in rungs}
    patches = _TimedPatches(full, ways, run.spec.seed, watched_frames(run.exposures.frames))
    imager: Any = run.model.make()
    decides = run.model.judge(imager, full, full, run.spec.seed) is not None
    imager.pixels = Taped(imager.pixels, NoTape(), patches)
    total = max(run.exposures.frames, 1)
    progress.start(f"{run.spec.name}: about {total} frames, everything kept", total)
    frames = pixels = 0
    for frame in imager.film(run.view.scenery, run.spec.stop, seed=run.spec.seed, kept=full):
        frames, pixels = frames + 1, pixels + frame.values.size
        progress.advance(min(frames, total))
    spent = patches.nanoseconds
    steps = [
        Step.measured(
            REFERENCE, None, Measured(0.0, 0.0, 0.0), spent.get(REFERENCE), pixels, effects
        )
    ]
    for rung in rungs:
        kept = [effect for effect in effects if effect in rung.plan]
        out = [effect for effect in effects if effect not in rung.plan]
        steps += rung.steps(patches.of(rung.name), spent.get(rung.name), pixels, kept, out)
    return ladder_document(
        steps,
        {
            "tier": REFERENCE, "patches": patches.count, "frames": frames,
            "ns_per_pixel_cycle": spent.get(REFERENCE),
            "decisions": "not compared" if decides else "none",
        },
        0.0, None,
    )  # fmt: skip
