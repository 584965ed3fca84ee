"""The check of a run: the plan of its camera, and of the display that shows the spikes.

The patches have displays as well, and the error is that of the radiance that the observer of the
display integrates. Without a display it is the check of the camera alone (`PlanCheck`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cosim import Block, Light
from cosim.compute.opencl import Device
from cosim.plan.error import BrokenPromise, Finding, Measured, accepted_error, reinstated
from cosim.plan.paired import Values, Words
from cosim.plan.tiles import PatchPlane
from cosim.run.result import Error
from display.trial.paired import (
    TRUTH,
    DisplayPatches,
    DisplayTrial,
    TrialDisplay,
    partial_displays,
)
from scenarios.assemble.camera.planning import RunPlan
from sensor import CameraSetting
from sensor.latched.check.plan_check import PlanCheck, absent_on
from sensor.latched.check.samples import TileSamples


class Verifier(PlanCheck, DisplayTrial):
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
            display = TrialDisplay(run.full_display, run.display, run.survey.scene.cycles)
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
        findings = []
        tiles = np.array(self.plane.tiles)
        for name, high in self._display_changes().items():
            promised = np.broadcast_to(self._plan.promise[name][tiles], high.shape)
            over = np.where(high > promised, high / np.maximum(promised, 1e-300), 0)
            if over.any():
                at = np.unravel_index(int(np.argmax(over)), over.shape)
                findings.append(
                    reinstated(name, float(promised[at]), float(high[at]), int(tiles[at[1]]))
                )
        return findings

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
        return Error(
            max(error.value, whole.value), f"{stated.kind}, {what}",
            (max(error.low, whole.low), max(error.high, whole.high * grown)),
            stated.tiles_checked, over,
        )  # fmt: skip

    def measured(self) -> dict[str, float]:
        """See `PlanCheck.measured`; with effects that the display leaves out."""
        return super().measured() | {
            name: float(high.max()) for name, high in self._display_changes().items()
        }
