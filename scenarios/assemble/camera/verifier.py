"""The verifier: the bounds of a plan, measured on a few patches with the same random counters.

It is a stage between lens and chip. It exposes the patches with several cameras at once: the
reference with every effect, the camera as planned, and in the exact tier one camera with every
effect and one without each effect that is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from cosim import Block, Light
from cosim.compute.opencl import Device
from cosim.plan.paired import Measured, Span, Values, compare, worst
from cosim.plan.patches import PatchPlane
from cosim.run.machine import BrokenPromise, Finding
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
from sensor.latched.patches import PatchCamera
from sensor.latched.tiers import Tier

__all__ = ["ARITHMETIC", "Verifier"]


ARITHMETIC: Final = "32-bit arithmetic"
"""The arithmetic of the fast tier, as an effect that may be reinstated: by the exact tier."""


def _finding(effect: str, promised: float, measured: float, tile: int | None) -> Finding:
    """tile: None if the whole error exceeds the tolerance, which is `promised` then."""
    remedy = "the exact tier" if effect == ARITHMETIC else f"{effect} kept"
    message = (
        f"the whole error was up to {measured:.2g} where {promised:.2g} was asked for: the run is "
        f"done again with {remedy}"
        if tile is None
        else f"the run is done again with {remedy}: leaving it out changed up to {measured:.2g} on "
        f"tile {tile}, where {promised:.2g} was promised"
    )
    return Finding(effect, message, promised, measured, tile)


class Verifier(DisplayTrial):
    """The stage that checks a plan.

    Args:
        run: the plan that is checked.
        full: the camera with every effect.
        tiles: whose pixels are the patches, of one size.
        device: OpenCL device of the fast tier, None without one.
        stop_early: whether `step` raises BrokenPromise at the end of a window that shows one.
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
        left = [name for name in plan.left_out if not plan.kept[name][plane.tiles].all()]
        self._partial = {} if display is None else partial_displays(display, left)
        self._left = [name for name in left if name not in self._partial]
        cameras = {
            "reference": PatchCamera(full, plane, "reference"),
            "run": run.on_patches(plane, device),
        }
        if self._left:
            cameras["all"] = PatchCamera(full, plane, "exact")
        for name in self._left:
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
            findings = self._broken_by_display()  # its images are complete
            if findings:
                raise BrokenPromise(findings)
        return out

    def reached(self, cycle: int) -> None:
        done = [span for span in self.spans if span[1] == cycle]
        findings = self._broken(done) if done and self._stop_early else []
        if findings:
            raise BrokenPromise(findings)

    def _changed(self, name: str, spans: Sequence[Span]) -> Values:
        """Upper limit of what leaving this out changed, (windows, patches)."""
        truth = self.rates("all", spans)
        return compare(self.rates(f"without {name}", spans), truth, self._floor)[2]

    def _broken(self, spans: Sequence[Span]) -> list[Finding]:
        findings = []
        tiles = np.array(self.plane.tiles)
        for name in self._left:
            high = self._changed(name, spans)
            promised, gone = self._plan.promise[name][tiles], ~self._plan.kept[name][tiles]
            over = np.where(gone & (high > promised), high / np.maximum(promised, 1e-300), 0)
            if over.any():
                at = np.unravel_index(int(np.argmax(over)), over.shape)
                tile = int(at[1])
                findings.append(
                    _finding(name, float(promised[tile]), float(high[at]), int(tiles[tile]))
                )
        return findings

    def _broken_by_display(self) -> list[Finding]:
        """Broken bounds of effects that the display left out, from complete images."""
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
        """Upper limit of what each effect that the display left out changed, (images, patches)."""
        if self.displays is None:
            return {}
        return {
            name: self.displays.limit(f"without {name}", before)
            for name, (before, _) in self._partial.items()
        }

    def broken(self) -> list[Finding]:
        """Promises that were not kept, over the whole run."""
        return self._broken(self.spans) + self._broken_by_display()

    def error(self) -> Measured:
        """The run against the reference: of radiance as the display's observer integrates it where
        there is a display, else of rates."""
        if self.displays is not None:
            return self.displays.error("run")
        return worst(self.rates("run"), self.rates("reference"), self._floor)

    def result_error(self) -> Error:
        """The error as `result.json` has it."""
        findings, patches = self.error(), len(self.plane.tiles)
        kind = f"measured on {patches} patches of {self.plane.numbers.size // patches} pixels"
        if self._display is not None:
            kind = f"radiance as {self._display.observer_name} integrates it, {kind}"
        return Error(findings.value, kind, (findings.low, findings.high))

    def measured(self) -> dict[str, float]:
        """Upper limit of what each left-out effect changed, where it was left out."""
        tiles = np.array(self.plane.tiles)
        return {
            name: float(self._changed(name, self.spans)[:, ~self._plan.kept[name][tiles]].max())
            for name in self._left
        } | {name: float(high.max()) for name, high in self._display_changes().items()}

    def shortfall(self, tier: Tier) -> list[Finding]:
        """What to reinstate because the whole error exceeds the tolerance: the effect whose absence
        changed most, or the fast tier itself."""
        error, tolerance = self.error(), self._plan.tolerance
        if tolerance == 0 or error.high <= tolerance:
            return []
        measured = self.measured()
        # An effect that no patch left out has not been measured; it is reinstated all the same.
        names = (
            [max(measured, key=lambda n: measured[n])] if measured else list(self._plan.left_out)
        )
        if not names and tier == "fast":
            names = [ARITHMETIC]
        return [_finding(name, tolerance, error.high, None) for name in names]

    def beyond(self) -> list[str]:
        """A note if the tolerance is exceeded with everything kept."""
        error, tolerance = self.error(), self._plan.tolerance
        if tolerance == 0 or error.high <= tolerance:
            return []
        return [
            f"the error is {error.value:.2g} (up to {error.high:.2g}) where {tolerance:g} was "
            "asked for, with every effect kept: the exact tier comes no nearer"
        ]

    def full_physics_s(self, pixels: int, cycles: int) -> float | None:
        """Seconds that the reference would take for so many pixels and cycles, from what it took
        for the patches."""
        seconds = self.ns("reference") * 1e-9 * pixels * cycles
        return seconds if math.isfinite(seconds) else None

    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json`: effects that some tile left out, with bound and measurement."""
        measured = self.measured()
        return [
            {
                "effect": row.effect, "bound": row.bound, "kind": row.kind,
                "measured": measured.get(row.effect),
            }
            for row in self._plan.rows if row.effect in self._plan.left_out
        ]  # fmt: skip
