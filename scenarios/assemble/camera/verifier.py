"""The verifier measures the bounds of a plan on a few patches, with common random numbers.

It is a stage between lens and chip. It exposes the patches with several cameras at once: the
reference with every effect, the planned camera, and, in the exact tier, one camera with every
effect and one without each effect that is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cosim import Block, Light
from cosim.compute.opencl import Device
from cosim.plan.paired import Measured, Span, Values, compare, worst
from cosim.plan.patches import PatchPlane
from cosim.plan.planner import accepted_error
from cosim.run.machine import BrokenPromise, Finding
from cosim.run.result import Error
from display.trial.paired import (
    TRUTH,
    DisplayPatches,
    DisplayTrial,
    TrialDisplay,
    partial_displays,
)
from scenarios.assemble.camera.planning import ARITHMETIC, RunPlan
from sensor import CameraSetting
from sensor.latched.patches import PatchCamera
from sensor.latched.tiers import Tier

__all__ = ["Verifier"]


def _finding(effect: str, promised: float, measured: float, tile: int | None) -> Finding:
    """The finding of an exceeded bound. If `tile` is None, the total error exceeds the tolerance
    `promised`."""
    remedy = "the exact tier" if effect == ARITHMETIC else f"{effect} kept"
    message = (
        f"the total error is up to {measured:.2g} where the tolerance is {promised:.2g}: the run "
        f"is repeated with {remedy}"
        if tile is None
        else f"the run is repeated with {remedy}: its absence changes up to {measured:.2g} on tile "
        f"{tile}, where the bound is {promised:.2g}"
    )
    return Finding(effect, message, promised, measured, tile)


class Verifier(DisplayTrial):
    """The stage that checks a plan.

    Args:
        run: the plan that is checked.
        full: the camera with every effect.
        tiles: numbers of the tiles that are the patches, all of one size.
        device: OpenCL device of the fast tier, None without one.
        stop_early: whether `step` raises BrokenPromise at the end of the window in which a bound is
            exceeded.
    """

    def __init__(
        self, run: RunPlan, full: CameraSetting, tiles: Sequence[int], device: Device | None,
        stop_early: bool = True,
    ) -> None:  # fmt: skip
        plan, display = run.plan, None
        if run.display is not None and run.full_display is not None:
            display = TrialDisplay(run.full_display, run.display, run.survey.scene.cycles)
        self._plan, self._floor, self._stop_early = plan, run.survey.scene.floor, stop_early
        plane = PatchPlane(run.survey.grid, sorted(tiles))
        absent = [name for name in plan.left_out if not plan.kept[name][plane.tiles].all()]
        self._partial = {} if display is None else partial_displays(display, absent)
        self._left_out = [name for name in absent if name not in self._partial]
        cameras = {
            "reference": PatchCamera(full, plane, "reference"),
            "run": run.on_patches(plane, device),
        }
        if self._left_out:
            cameras["all"] = PatchCamera(full, plane, "exact")
        for name in self._left_out:
            cameras[f"without {name}"] = PatchCamera(full.without([name]), plane, "exact")
        self._display, patches = display, None
        if display is not None:
            displays = {TRUTH: ("reference", display.full), "run": ("run", display.run)}
            for name, (_, without) in self._partial.items():
                displays[f"without {name}"] = "reference", without
            patches = DisplayPatches(plane, displays, self._floor)
        super().__init__(plane, cameras, run.spans, patches)

    def step(self, light: Light, block: Block) -> Light:
        out = super().step(light, block)
        if self._display is not None and block.stop == self._display.cycles and self._stop_early:
            findings = self._broken_by_display()  # the display's images are complete
            if findings:
                raise BrokenPromise(findings)
        return out

    def reached(self, cycle: int) -> None:
        done = [span for span in self.spans if span[1] == cycle]
        findings = self._broken(done) if done and self._stop_early else []
        if findings:
            raise BrokenPromise(findings)

    def _changed(self, name: str, spans: Sequence[Span]) -> Values:
        """Upper limit of the change without the effect, relative, (windows, patches)."""
        truth = self.rates("all", spans)
        return compare(self.rates(f"without {name}", spans), truth, self._floor)[2]

    def _broken(self, spans: Sequence[Span]) -> list[Finding]:
        findings = []
        tiles = np.array(self.plane.tiles)
        for name in self._left_out:
            high = self._changed(name, spans)
            promised, absent = self._plan.promise[name][tiles], ~self._plan.kept[name][tiles]
            over = np.where(absent & (high > promised), high / np.maximum(promised, 1e-300), 0)
            if over.any():
                at = np.unravel_index(int(np.argmax(over)), over.shape)
                tile = int(at[1])
                findings.append(
                    _finding(name, float(promised[tile]), float(high[at]), int(tiles[tile]))
                )
        return findings

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
                    _finding(name, float(promised[at]), float(high[at]), int(tiles[at[1]]))
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
        return self._broken(self.spans) + self._broken_by_display()

    def error(self) -> Measured:
        """The error of the run against the reference: of the radiance that the observer of the
        display integrates, or of rates without a display."""
        if self.displays is not None:
            return self.displays.error("run")
        return worst(self.rates("run"), self.rates("reference"), self._floor)

    def result_error(self) -> Error:
        """The error for `result.json`."""
        error, patches = self.error(), len(self.plane.tiles)
        kind = f"measured on {patches} patches of {self.plane.numbers.size // patches} pixels"
        if self._display is not None:
            kind = f"radiance as {self._display.observer_name} integrates it, {kind}"
        return Error(error.value, kind, (error.low, error.high))

    def measured(self) -> dict[str, float]:
        """Upper limit of the change without each effect that is left out, over the patches that
        leave it out."""
        tiles = np.array(self.plane.tiles)
        return {
            name: float(self._changed(name, self.spans)[:, ~self._plan.kept[name][tiles]].max())
            for name in self._left_out
        } | {name: float(high.max()) for name, high in self._display_changes().items()}

    def shortfall(self, tier: Tier) -> list[Finding]:
        """Findings if the total error exceeds the tolerance: the effect whose absence changes the
        rate most, or the arithmetic of the fast tier."""
        error, tolerance = self.error(), self._plan.tolerance
        if tolerance == 0 or error.high <= tolerance:
            return []
        measured = self.measured()
        # Effects that no patch leaves out are not measured; all of them are reinstated then.
        names = (
            [max(measured, key=lambda n: measured[n])] if measured else list(self._plan.left_out)
        )
        if not names and tier == "fast":
            names = [ARITHMETIC]
        return [_finding(name, tolerance, error.high, None) for name in names]

    def beyond(self) -> list[str]:
        """A note if the error exceeds the tolerance with every effect kept."""
        error, tolerance = self.error(), self._plan.tolerance
        accepted = accepted_error(tolerance)
        if error.high <= accepted:
            return []
        limit = "" if tolerance > 0 else f" (at most {accepted:g} is accepted)"
        return [
            f"the error is {error.value:.2g} (up to {error.high:.2g}) where the tolerance is "
            f"{tolerance:g}{limit}, with every effect kept: it is the limit of the exact tier"
        ]

    def full_physics_s(self, pixels: int, cycles: int) -> float | None:
        """Predicted run time of the reference for `pixels` and `cycles`, s, from its time on the
        patches; None if that is unknown."""
        seconds = self.ns("reference") * 1e-9 * pixels * cycles
        return seconds if math.isfinite(seconds) else None

    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json`: effects that at least one tile leaves out, with bound and
        measurement."""
        measured = self.measured()
        return [
            {
                "effect": row.effect, "bound": row.bound, "kind": row.kind,
                "measured": measured.get(row.effect),
            }
            for row in self._plan.rows if row.effect in self._plan.left_out
        ]  # fmt: skip
