"""The plan of a synchronous run: tier, effects tile by tile, the patches that check it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Summary
from cosim.compute.opencl import Device
from cosim.light.source import Source
from cosim.light.survey import Survey, survey, through
from cosim.plan.paired import windows
from cosim.plan.planner import ESTIMATE_WEIGHT, SHARE, Plan, make_plan
from cosim.plan.tiles import TileGrid
from display import DisplaySetting
from display.effects import SHOWN, effective_planes
from scenarios.assemble.scenario import Scenario
from scenarios.assemble.shown import Shown
from scenarios.assemble.verifier import Planned, Verifier
from sensor import CameraSetting
from sensor.latched.effects.costs import QUIET
from sensor.latched.effects.windows import saturated, shifted
from sensor.latched.tiers import Tier

__all__ = ["RunPlan", "SceneSurvey", "floor_of", "plan_run", "survey_scene"]

RANDOM = 4
"""Patches that are chosen by chance, from the run's seed."""
FAULT = 2
"""Patches where each left-out effect has promised most."""


@dataclass(frozen=True, eq=False)
class SceneSurvey:
    """What a plan reads of a scene, before anything is simulated.

    Attributes:
        light: interval of every pixel's light, lux on the sensor.
        grid: tiles of the plane.
        scene: the same by tile, photoelectrons a cycle.
        certain: (tiles,) bool, whether the interval holds for certain.
    """

    light: Survey
    grid: TileGrid
    scene: Summary
    certain: npt.NDArray[np.bool_]

    @property
    def classes(self) -> dict[str, int]:
        """Tiles by what their light is: dark (none), constant, moving."""
        dark = np.asarray(self.scene.brightest) <= 0
        steady = self.grid.reduce(self.light.steady, np.logical_and) & ~dark
        return {
            "dark": int(dark.sum()),
            "constant": int(steady.sum()),
            "moving": int((~dark & ~steady).sum()),
        }


@dataclass(frozen=True, eq=False)
class RunPlan:
    """tier: of the run. setting: the camera as it is run, with what some tile keeps. flags: of the
    fast tier's work-items. own: bound of the tier's own error. spans: windows that are checked.
    display: what shows the stream, as it is run, and full_display with everything; None for none.
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
        """Tiles to check, the most telling first: the brightest, the darkest, the steepest, where
        each left-out effect has promised most, some by chance, and one of every set of effects that
        has none yet."""
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

    def verifier(
        self, full: CameraSetting, seed: int, device: Device | None, stop_early: bool = True
    ) -> Verifier:
        """The stage that checks this plan. full: the camera with every effect."""
        shown = None
        if self.display is not None and self.full_display is not None:
            shown = Shown(self.full_display, self.display, self.survey.scene.cycles)
        return Verifier(
            full, self.plan, self.survey.grid, sorted(self.patches(seed)),
            Planned(self.tier, self.setting, self.flags), self.spans, self.survey.scene.floor,
            device, stop_early, shown,
        )  # fmt: skip


def floor_of(scenario: Scenario) -> float:
    """Spikes a cycle below which an error counts as if the rate were this: a spike in the window
    unless the scenario says."""
    floor = scenario.image.floor
    return 1 / scenario.image.window if floor is None else floor


def survey_scene(
    scenario: Scenario,
    setting: CameraSetting,
    source: Source,
    relay: Callable[[Light], Light],
    cycles: int,
) -> SceneSurvey:
    """Surveys a scene. source: one of its own, since it may be run through."""
    clock: Clock = setting.clock
    light = through(survey(source, clock, cycles), relay)
    grid = TileGrid(*light.least.shape)
    from scipy.ndimage import maximum_filter, minimum_filter

    per_cycle = setting.electrons_per_lux * float(clock.period)
    low, high = light.least, light.most
    if setting.crosstalk > 0:  # what a neighbour has, a pixel may get
        low, high = minimum_filter(low, 3), maximum_filter(high, 3)
    darkest = grid.reduce(low, np.minimum).astype(float) * per_cycle
    brightest = grid.reduce(high, np.maximum).astype(float) * per_cycle
    if setting.pattern is not None:
        own = setting.pattern.dark * float(clock.period)
        brightest = brightest + own * (1 + 4 * setting.pattern.dsnu)
    moving = ~grid.reduce(light.steady, np.logical_and)
    scene = Summary(
        darkest, brightest, setting.threshold, scenario.image.window, cycles, floor_of(scenario),
        setting.spread, np.where(moving, light.planes, 0.0), setting.slack,
        setting.dead_time * clock.hz,
    )  # fmt: skip
    certain = light.certain
    if setting.crosstalk > 0:
        certain = minimum_filter(certain, 3)
    return SceneSurvey(light, grid, scene, grid.reduce(certain, np.logical_and))


def _flags(plan: Plan, grid: TileGrid) -> npt.NDArray[np.uint8]:
    """Bit 0: thresholds are drawn; bit 1: dead time."""
    none = np.zeros(len(grid), bool)
    noise = plan.kept.get("shot noise", none) | plan.kept.get("threshold noise", none)
    dead = plan.kept.get("reset dead time", none)
    return grid.groups((noise.astype(np.uint8) | (dead.astype(np.uint8) << 1)).astype(np.uint8))


def _seen_through(scene: Summary, display: DisplaySetting) -> Summary:
    """The scene with the window that a display's observer takes a rate over: as many planes as
    count alike in its images, if those are fewer."""
    planes = effective_planes(display.observer, display.panel, scene.cycles)
    return replace(scene, window=max(1, min(scene.window, round(planes))))


def plan_run(
    seen: SceneSurvey,
    setting: CameraSetting,
    tolerance: float,
    instants: Sequence[int],
    device: Device | None,
    *,
    forced: Sequence[str] = (),
    tier: Tier | None = None,
    display: DisplaySetting | None = None,
) -> RunPlan:
    """Plans a run of this camera over this scene. tier: chosen by the tolerance unless given.

    display: what shows the stream, with everything. Its bounds and the camera's share the tolerance
    and add up: the camera's are relative changes of a pixel's rate over a window (the observer's
    own where that is shorter), and an image of the panel is a weighted mean of its light, which
    follows the rate. That assumes whole spikes to be as good as fractions: for packets the window
    must hold many, for hold and causal the intervals must be short beside it. What a spike more or
    less at the ends of the weights does, and 1 / tau over a longer interval, the check measures.
    """
    scene = seen.scene if display is None else _seen_through(seen.scene, display)
    own = setting.lumped_error
    if tier is None:
        tier = "exact"
        if device is not None and tolerance > 0:
            fast = fast_bound(setting, scene)
            tier = "fast" if fast <= SHARE * tolerance / 2 else "exact"
    if tier == "fast":
        own += fast_bound(setting, scene)
    effects = setting.kept
    if tier != "fast":  # it runs all tiles alike
        effects = tuple(replace(effect, scope="plane") for effect in effects)
    if display is not None:
        effects += display.kept
    plan = make_plan(
        effects, scene, tolerance, certain=seen.certain, own=own, forced=forced,
        base_ns=QUIET + (0.0 if display is None else SHOWN),
    )  # fmt: skip
    flags = _flags(plan, seen.grid) if tier == "fast" else None
    gone = [name for name, tiles in plan.kept.items() if not tiles.any()]
    spans = windows(instants, seen.scene.window, scene.cycles)
    shown = None if display is None else display.without(gone)
    return RunPlan(plan, seen, tier, setting.without(gone), flags, own, spans, shown, display)


def fast_bound(setting: CameraSetting, scene: Summary) -> float:
    """Relative error of the fast tier's own arithmetic against the exact tier's in the worst tile:
    twice the lesser of its proof for the nominal pixel, in which every rounding of the run goes the
    same way, and of an estimate.

    Estimated: a rounding of float32 and half a unit a cycle, and the quantile's error a spike, move
    the rate; what they add up to over the run shifts the spikes against their draws.
    """
    from sensor.latched.fast import units_of

    if setting.reset != "residual":  # not smooth in its charge
        return ESTIMATE_WEIGHT * _fast_proof(setting, scene)
    units, q = units_of(setting.model), setting.model.mean
    unit = 2.0**-units.bits
    spikes = np.asarray(scene.brightest, np.float64) / q
    cycle = unit / 2 + 2.0**-23 * spikes + units.error * unit * spikes
    guess = scene.relative(cycle * q) + shifted(scene, cycle * scene.cycles)
    twice = ESTIMATE_WEIGHT * np.where(saturated(scene), 0.0, guess)
    return min(ESTIMATE_WEIGHT * _fast_proof(setting, scene), float(np.max(twice)))


def _fast_proof(setting: CameraSetting, scene: Summary) -> float:
    """Infinite where nothing is promised. Tiles under the shortest threshold are one case, those
    beyond the longest another; one in between has no promise."""
    from sensor.latched.fast import rate_bound

    model = setting.model
    low, high = np.broadcast_arrays(scene.darkest, scene.brightest)

    def worst(tiles: npt.NDArray[np.bool_]) -> float:
        if not tiles.any():
            return 0.0
        least, most = float(low[tiles].min()), float(high[tiles].max())
        return float(rate_bound(model, least, most, scene.window, scene.floor, scene.cycles).value)

    bright = low > model.mean
    return max(worst(bright), worst(~bright))
