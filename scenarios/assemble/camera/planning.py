"""The plan of a synchronous run: tier, effects tile by tile, the patches that check it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim import Summary
from cosim.compute.opencl import Device
from cosim.plan.paired import windows
from cosim.plan.patches import PatchPlane
from cosim.plan.planner import SHARE, Plan, make_plan
from cosim.plan.tiles import TileGrid
from display import DisplaySetting
from display.effects import SHOWN, effective_planes
from sensor import CameraSetting
from sensor.latched.effects.costs import QUIET
from sensor.latched.fast.promise import fast_bound
from sensor.latched.patches import PatchCamera
from sensor.latched.survey import SceneSurvey
from sensor.latched.tiers import Tier

__all__ = ["RunPlan", "plan_run"]

RANDOM = 4
"""Patches that are chosen by chance, from the run's seed."""
FAULT = 2
"""Patches where each left-out effect has promised most."""


@dataclass(frozen=True, eq=False)
class RunPlan:
    """How a camera, and the display that its stream drives, will be simulated.

    Attributes:
        plan: effects that are kept, by tile.
        survey: what the plan was made from.
        tier: of the camera.
        setting: the camera as it is run, with the effects that some tile keeps.
        flags: of the fast tier's work-items, (height, groups) uint8; None in the exact tier.
        own: bound of the tier's own error, relative.
        spans: windows of cycles that are checked.
        display: the display as it is run, None without one.
        full_display: the display with every effect.
    """

    plan: Plan
    survey: SceneSurvey
    tier: Tier
    setting: CameraSetting
    flags: npt.NDArray[np.uint8] | None
    own: float
    spans: list[tuple[int, int]]
    display: DisplaySetting | None = None
    full_display: DisplaySetting | None = None

    def patches(self, seed: int) -> list[int]:
        """Tiles to check, the most informative first: the brightest, the darkest, the steepest,
        those with the largest bound of each effect left out, some by chance, and one of every set
        of effects that has none yet."""
        scene, grid = self.survey.scene, self.survey.grid
        whole = np.flatnonzero(grid.whole)
        low, high = (np.asarray(x)[whole] for x in (scene.darkest, scene.brightest))
        steep = (high - low) / np.maximum(low, max(scene.floor, 1e-300) * scene.threshold)
        order = [int(np.argmax(high)), int(np.argmin(low)), int(np.argmax(steep))]
        for name in self.plan.left_out:
            promised = np.where(self.plan.kept[name], -1.0, self.plan.promise[name])[whole]
            order += np.argsort(-promised, kind="stable")[:FAULT].tolist()
        chance = np.random.default_rng(seed).permutation(len(whole))[:RANDOM]
        chosen = dict.fromkeys(int(whole[n]) for n in [*order, *chance.tolist()])
        chosen |= dict.fromkeys(self._uncovered(np.array(list(chosen)), whole, seed))
        return list(chosen)

    def _uncovered(
        self, chosen: npt.NDArray[np.intp], whole: npt.NDArray[np.intp], seed: int
    ) -> list[int]:
        """A tile by chance of each set of effects that none of `chosen` has."""
        kept = np.stack(
            [np.broadcast_to(k, len(self.survey.grid)) for k in self.plan.kept.values()]
        )
        _, which = np.unique(kept, axis=1, return_inverse=True)
        which = which.ravel()
        rng = np.random.default_rng([seed, 1])
        missing = np.setdiff1d(which[whole], which[chosen])
        return [int(rng.choice(whole[which[whole] == one])) for one in missing]

    def on_patches(self, plane: PatchPlane, device: Device | None) -> PatchCamera:
        """The camera as planned, on patches that are tiles of the survey's grid."""
        flags = None
        if self.flags is not None:
            rows = plane.row.reshape(len(plane.tiles), -1)
            columns = np.array(plane.tiles) % self.survey.grid.shape[1]
            flags = self.flags[rows, columns[:, None]].reshape(-1, 1)
        return PatchCamera(
            self.setting, plane, self.tier, device if self.tier == "fast" else None, flags
        )


def _flags(plan: Plan, grid: TileGrid) -> npt.NDArray[np.uint8]:
    """Bit 0: thresholds are drawn; bit 1: dead time."""
    none = np.zeros(len(grid), bool)
    noise = plan.kept.get("shot noise", none) | plan.kept.get("threshold noise", none)
    dead = plan.kept.get("reset dead time", none)
    return grid.groups((noise.astype(np.uint8) | (dead.astype(np.uint8) << 1)).astype(np.uint8))


def _through_observer(scene: Summary, display: DisplaySetting) -> Summary:
    """The scene with the window that a display's observer takes a rate over: as many planes as
    count alike in its images, if those are fewer."""
    planes = effective_planes(display.observer, display.panel, scene.cycles)
    return replace(scene, window=max(1, min(scene.window, round(planes))))


def plan_run(
    survey: SceneSurvey,
    setting: CameraSetting,
    tolerance: float,
    instants: Sequence[int],
    device: Device | None,
    *,
    forced: Sequence[str] = (),
    tier: Tier | None = None,
    display: DisplaySetting | None = None,
) -> RunPlan:
    """Plans a run of this camera over this scene.

    The bounds of a display and of the camera share the tolerance and add up. The camera's are
    relative changes of a pixel's rate over a window (the observer's own if that is shorter); an
    image of the panel is a weighted mean of its light, which follows the rate. This takes whole
    spikes to be as good as fractions: packets need many spikes in a window, hold and causal need
    intervals that are short beside it. The check measures what one spike more or less at the ends
    of the weights changes, and 1 / tau over a longer interval.

    Args:
        survey: of the scene.
        setting: the camera with every effect.
        tolerance: relative error allowed; 0 keeps everything.
        instants: cycles of the images.
        device: OpenCL device, None without one.
        forced: effects to keep whatever their bound.
        tier: chosen by the tolerance if None.
        display: the display with every effect, None without one.
    """
    scene = survey.scene if display is None else _through_observer(survey.scene, display)
    own = setting.lumped_error
    if tier is None:
        tier = "exact"
        if device is not None and tolerance > 0:
            fast = fast_bound(setting, scene)
            tier = "fast" if fast <= SHARE * tolerance / 2 else "exact"
    if tier == "fast":
        own += fast_bound(setting, scene)
    effects = setting.acting_effects
    if tier != "fast":  # the exact tier runs all tiles alike
        effects = tuple(replace(effect, scope="plane") for effect in effects)
    if display is not None:
        effects += display.acting_effects
    plan = make_plan(
        effects, scene, tolerance, certain=survey.certain, tier_error=own, forced=forced,
        base_ns=QUIET + (0.0 if display is None else SHOWN),
    )  # fmt: skip
    flags = _flags(plan, survey.grid) if tier == "fast" else None
    gone = [name for name, tiles in plan.kept.items() if not tiles.any()]
    spans = windows(instants, survey.scene.window, scene.cycles)
    planned = None if display is None else display.without(gone)
    return RunPlan(plan, survey, tier, setting.without(gone), flags, own, spans, planned, display)
