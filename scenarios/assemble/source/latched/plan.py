"""The plan of a latched camera and of the display that its stream drives, and its check.

On the patches of the check there are displays as well, and the error is that of the radiance that
the observer of the display integrates. Without a display it is the check of the camera alone
(`PlanCheck`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Light
from cosim.compute.opencl import Device
from cosim.plan.effects import Effect, Summary
from cosim.plan.error import BrokenPromise, Finding, Measured, accepted_error
from cosim.plan.paired import Span, Values, Words
from cosim.plan.tiles import PatchPlane
from cosim.run.result import Error
from display import DisplaySetting
from display.effects import BASE_COST, effective_planes, weight_steps
from display.plan.paired import (
    TRUTH,
    CheckDisplay,
    DisplayCheck,
    DisplayPatches,
    partial_displays,
)
from sensor import CameraSetting
from sensor.latched.arithmetic import moved_spikes
from sensor.latched.check.plan_check import PlanCheck, absent_on
from sensor.latched.check.samples import TileSamples
from sensor.latched.effects.windows import SHARES, rare_error
from sensor.latched.planning import CameraPlan, plan_camera
from sensor.latched.survey import SceneSurvey
from sensor.latched.tiers import Tier

HELD: Final = (1, 2, 4, 8, 16, 64)
"""Numbers of planes over which a drive holds a packet at least, by the brightest rate of a tile."""


class _Shown:
    """A display behind a camera; see `sensor.latched.planning.Behind`."""

    base_cost = BASE_COST

    def __init__(self, display: DisplaySetting) -> None:
        self._display = display

    @property
    def acting_effects(self) -> tuple[Effect, ...]:
        return self._display.acting_effects

    def seen(self, scene: Summary) -> Summary:
        """The survey with the effective number of planes in the images of the display's observer as
        its window, if that is smaller."""
        planes = effective_planes(self._display.observer, self._display.panel, scene.cycles)
        return replace(scene, window=max(1, min(scene.window, round(planes))))

    def moved_light(
        self, setting: CameraSetting, scene: Summary, tier: Tier, *, end: bool
    ) -> npt.NDArray[np.float64]:
        """See `Behind`.

        A packet that moves by a plane changes an image by the difference of the weights. A drive
        that holds the light spreads a packet over its interval, and with it the difference. The
        planes are taken in classes of similar differences; the number of moved spikes in each is
        Poisson distributed (`rare_error`).
        """
        panel, observer = self._display.panel, self._display.observer
        moved = moved_spikes(setting, scene, tier)
        moved = np.exp2(np.ceil(4 * np.log2(np.maximum(moved, 1e-300))) / 4)  # few distinct values
        rate = np.asarray(scene.brightest, np.float64) / scene.threshold
        error = np.zeros(np.broadcast(scene.darkest, scene.brightest).shape)
        held = (1,) if panel.packets else HELD
        for least, longer in zip(held, (*held[1:], None), strict=True):
            tiles = rate * least <= 1 if least > 1 else np.ones(rate.shape, bool)
            if longer is not None:
                tiles &= rate * longer > 1
            square = np.zeros(error.shape)
            for size, planes in weight_steps(observer, panel, scene.cycles, least, end):
                # At the end of the run a single interval changes, 1 / tau to 1 / (tau + 1).
                change = size * scene.window * (0.5 if end and not panel.packets else 1.0)
                shares = (1.0,) if end else SHARES
                square += rare_error(scene, moved * planes, change, shares) ** 2
            error = np.where(tiles, np.sqrt(square), error)
        return error


@dataclass(frozen=True, eq=False)
class RunPlan(CameraPlan):
    """The plan of a camera and of the display that its stream drives.

    Attributes:
        display: the simulated display, None without one.
        full_display: the display with every effect, None without one.
    """

    display: DisplaySetting | None = None
    full_display: DisplaySetting | None = None


def plan_run(
    survey: SceneSurvey,
    setting: CameraSetting,
    tolerance: float,
    spans: Sequence[Span],
    device: Device | None,
    *,
    display: DisplaySetting | None = None,
    **choice: Any,
) -> RunPlan:
    """Plans the run of a camera over a scene.

    The bounds of the display and of the camera add up and share the tolerance. A bound of the
    camera is a relative change of a pixel's rate over a window (the window of the observer if that
    is shorter). An image of the panel is a weighted mean of its light, which follows the rate. This
    argument neglects that spikes are integers: the impulse drive needs many spikes in a window;
    hold and causal drives need intervals that are short compared with it. The check measures the
    effect of one spike more or less at the ends of the weights, and of 1 / tau over a longer
    interval.

    Args:
        survey, setting, tolerance, spans, device, **choice: see `plan_camera`.
        display: the display with every effect, None without one.
    """
    behind = None if display is None else _Shown(display)
    made = plan_camera(survey, setting, tolerance, spans, device, behind=behind, **choice)
    absent = [name for name, tiles in made.plan.kept.items() if not tiles.any()]
    left = None if display is None else display.without(absent)
    return RunPlan(**vars(made), display=left, full_display=display)


class CameraCheck(PlanCheck, DisplayCheck):
    """The stage that checks a plan.

    Args:
        run: the plan that is checked.
        full: the camera with every effect.
        tiles: numbers of the tiles that are the patches, all of one size.
        device: OpenCL device of the fast tier, None without one.
        samples: samples of other tiles, None without any.
        keep: keeps the spikes of the patches before a display, for `error_behind`.
    """

    def __init__(
        self, run: RunPlan, full: CameraSetting, tiles: Sequence[int], device: Device | None,
        samples: TileSamples | None = None, keep: bool = False,
    ) -> None:  # fmt: skip
        display, patches = None, None
        plane = PatchPlane(run.survey.grid, sorted(tiles))
        if run.display is not None and run.full_display is not None:
            display = CheckDisplay(run.full_display, run.display, run.survey.scene.cycles)
        self._display = display
        self._partial = {} if display is None else partial_displays(display, absent_on(run, plane))
        if display is not None:
            displays = {TRUTH: ("reference", display.full), "run": ("run", display.run)}
            for name, (_, without) in self._partial.items():
                displays[f"without {name}"] = "reference", without
            patches = DisplayPatches(plane, displays, run.survey.scene.floor, keep)
        super().__init__(run, full, plane, device, samples, self._partial, patches)

    def step(self, light: Light, block: Block) -> Light:
        out = super().step(light, block)
        if self._display is not None and block.stop == self._display.cycles:
            findings = self._broken_by_display()  # the display's images are complete
            if findings:
                raise BrokenPromise(findings)
        return out

    def _broken_by_display(self) -> list[Finding]:
        """Exceeded bounds of effects that the display leaves out, from complete images."""
        return self._exceeded(self._display_changes())

    def _display_changes(self) -> dict[str, Values]:
        """Upper limit of the change without each effect that the display leaves out, relative,
        (images, patches)."""
        if self.displays is None:
            return {}
        return {
            name: self.displays.limit(f"without {name}", before)
            for name, (before, _) in self._partial.items()
        }

    def broken(self) -> list[Finding]:
        """Exceeded bounds over the whole run."""
        return super().broken() + self._broken_by_display()

    def patches_error(self) -> Measured:
        """The error of the patches against the reference: of the radiance that the observer of the
        display integrates, or of rates without a display."""
        return super().patches_error() if self.displays is None else self.displays.error("run")

    def errors(self) -> Values:
        """The error of each patch, (windows or images, patches)."""
        return super().errors() if self.displays is None else self.displays.errors("run")

    def result_error(self) -> Error:
        """The error for `result.json`."""
        error = super().result_error()
        if self._display is None:
            return error
        kind = f"radiance as {self._display.observer_name} integrates it, {error.kind}"
        return replace(error, kind=kind)

    def error_behind(self, change: Callable[[Words, int], Words], what: str) -> Error:
        """The error of the display behind a part that changes the spikes, such as a code. Needs
        `keep` and a display. The bounds of the tiles that are not patches grow as the error of the
        patches does.

        Args:
            change: map from the words of the patches, (words, pixels), and their cycles, to others.
            what: names the part, for the result.
        """
        assert self.displays is not None
        behind = self.displays.replayed((TRUTH, "run"), change)
        error, own, whole = behind.error("run"), self.patches_error(), self.error()
        grown = max(error.high / own.high, 1.0) if own.high > 0 else 1.0
        limit = accepted_error(self._plan.tolerance)
        over = int((behind.errors("run").max(axis=0) > limit).sum())
        stated = self.result_error()
        return replace(
            stated, value=max(error.value, whole.value), kind=f"{stated.kind}, {what}",
            ci=(max(error.low, whole.low), max(error.high, whole.high * grown)), tiles_over=over,
        )  # fmt: skip

    def measured(self) -> dict[str, float]:
        """See `PlanCheck.measured`; with effects that the display leaves out."""
        return super().measured() | {
            name: float(high.max()) for name, high in self._display_changes().items()
        }
