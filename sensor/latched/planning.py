"""The plan of a latched camera: tier, effects tile by tile, and the patches that check it.

What shows the camera's spikes, such as a display, has a share of the plan (`Behind`): its effects
may be left out as well, and its observer says what a moved spike changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.plan.effects import Effect, Summary
from cosim.plan.error import Of, accepted_error
from cosim.plan.paired import CheckCamera, Span
from cosim.plan.planner import ESTIMATE_WEIGHT, SHARE, Plan, choose_tiles, make_plan
from cosim.plan.tiles import PatchPlane, TileGrid
from sensor.latched.arithmetic import exact_error, fast_error
from sensor.latched.camera import Gathering, SpikeCamera
from sensor.latched.effects.effect import EXACT, QUIET, reference_cost
from sensor.latched.effects.own_draws import OWN_DRAWS, Draws, with_own_draws
from sensor.latched.fast.units import BANK, DEAD_TIME, NOISE
from sensor.latched.fine_tiles import FineTiles, MixedPatches, PatchCamera
from sensor.latched.levels import error_over_levels, fast_can_follow, planned_effects
from sensor.latched.setting import CameraSetting
from sensor.latched.survey import SceneSurvey
from sensor.latched.tiers import Tier, TierPixels

FAST_PART: Final = 0.6
"""Part of what left-out effects may use that the fast tier's arithmetic may use."""
FAULT = 2
"""Number of patches, for each effect left out, where its bound is largest."""


class Behind(Protocol):
    """What shows the spikes of a camera, for the plan of both.

    Attributes:
        acting_effects: its effects that may be left out.
        base_cost: its cost without them, ns per pixel-cycle.
    """

    @property
    def acting_effects(self) -> tuple[Effect, ...]: ...
    @property
    def base_cost(self) -> float: ...
    def seen(self, scene: Summary) -> Summary:
        """The survey with the window over which the observer averages."""
        ...

    def moved_light(
        self, setting: CameraSetting, scene: Summary, tier: Tier, *, end: bool
    ) -> npt.NDArray[np.float64]:
        """Relative change of an image by spikes that a tier latches a cycle early or late,
        (tiles,). end: only by those that leave the run at its end, for tiles of uniform light; else
        without these."""
        ...


@dataclass(frozen=True, eq=False)
class CameraPlan:
    """The plan of a camera.

    Attributes:
        plan: effects that are kept, by tile.
        survey: survey of the scene for which the plan is made.
        tier: tier of the camera.
        setting: the simulated camera, with the effects that at least one tile keeps.
        flags: flags of the fast tier's work-items, (height, groups) uint8; None in the exact tier.
        tier_error: (tiles,) bound of the error of the arithmetic, relative.
        fine: (tiles,) bool, tiles that a better tier simulates, with every effect, and with the
            lumped form of a circuit.
        exact: (tiles,) bool, those of them that the exact tier simulates; the others have the
            reference.
        full: the camera with every effect.
        spans: windows of cycles that are checked.
        end_error: (tiles,) limit of the change of an image by spikes that the tier latches across
            the end of the run, relative. It is a part of the stated error, but the plan does not
            avoid it.
    """

    plan: Plan
    survey: SceneSurvey
    tier: Tier
    setting: CameraSetting
    flags: npt.NDArray[np.uint8] | None
    tier_error: npt.NDArray[np.float64]
    fine: npt.NDArray[np.bool_]
    exact: npt.NDArray[np.bool_]
    full: CameraSetting
    spans: Sequence[Span]
    end_error: npt.NDArray[np.float64] | float = 0.0

    @property
    def full_physics(self) -> int:
        """Number of tiles that the reference simulates."""
        return int((self.fine & ~self.exact).sum())

    def patches(self, seed: int) -> list[int]:
        """Numbers of the tiles to check, the most informative first: the brightest, the darkest,
        and the one with the largest contrast over time; those with the largest bound of each effect
        left out; some at random; and one for every further set of effects."""
        scene, grid = self.survey.scene, self.survey.grid
        whole = np.flatnonzero(grid.whole & ~self.fine)
        if not whole.size:
            whole = np.flatnonzero(grid.whole)
        low, high = np.asarray(scene.darkest), np.asarray(scene.brightest)
        steep = (high - low) / np.maximum(low, max(scene.floor, 1e-300) * scene.threshold)
        chosen = choose_tiles(self.plan, (high, -low, steep), whole, seed, FAULT)
        return [*chosen, *self._uncovered(np.array(chosen), whole, seed)]

    def _uncovered(
        self, chosen: npt.NDArray[np.intp], whole: npt.NDArray[np.intp], seed: int
    ) -> list[int]:
        """A random tile for each set of effects that no tile of `chosen` has."""
        kept = np.stack(
            [np.broadcast_to(k, len(self.survey.grid)) for k in self.plan.kept.values()]
        )
        _, which = np.unique(kept, axis=1, return_inverse=True)
        which = which.ravel()
        rng = np.random.default_rng([seed, 1])
        missing = np.setdiff1d(which[whole], which[chosen])
        return [int(rng.choice(whole[which[whole] == one])) for one in missing]

    @property
    def from_bank(self) -> npt.NDArray[np.bool_]:
        """Tiles whose thresholds come from the bank, (tiles,)."""
        tiles = len(self.survey.grid)
        if self.tier != "fast":
            return np.zeros(tiles, bool)
        return np.broadcast_to(_banked(self.plan, tiles) & ~self.fine, tiles)

    @property
    def of(self) -> Of:
        """What the error of the run is of: in law, where a tile takes the bank."""
        return "law" if self.from_bank.any() else "run"

    @property
    def bank_bound(self) -> npt.NDArray[np.float64]:
        """Distance of the law of a rate by the bank from that of a draw for each spike, relative,
        (tiles,): what two runs differ by if their draws are paired as well as they can be. It is
        an estimate; 0 in tiles without the bank."""
        if self.of == "run":
            return np.zeros(len(self.survey.grid))
        promised = np.broadcast_to(self.plan.promise[OWN_DRAWS], self.from_bank.shape)
        return np.where(self.from_bank, promised / ESTIMATE_WEIGHT, 0.0)

    @property
    def notes(self) -> list[str]:
        """Notes for the user on the choice of the tier."""
        if self.tier == "exact" and not fast_can_follow(self.full, self.survey.scene):
            return [
                "sensor.writes: the exact tier runs, as the bounds of the fast tier do not hold "
                "across these writes"
            ]
        return []

    @property
    def promised(self) -> npt.NDArray[np.float64]:
        """(tiles,) bound of the whole error, relative: of what is left out, and of arithmetic."""
        return self.plan.total + self.tier_error

    def camera(
        self, device: Device | None, like: TierPixels | None = None,
        gathering: Gathering | None = None,
    ) -> SpikeCamera:  # fmt: skip
        """The planned camera. like, gathering: see `SpikeCamera`."""
        return SpikeCamera(
            self.setting, device, tier=self.tier, flags=self.flags, fine=self.fine_tiles(device),
            like=like, gathering=gathering,
        )  # fmt: skip

    def fine_tiles(self, device: Device | None) -> FineTiles | None:
        """The tiles of the planned camera that a better tier simulates; None for none."""
        if not self.fine.any():
            return None
        return FineTiles(self.full.lumped, self.survey.grid, self._better(), device)

    def _better(self, tiles: Any = slice(None)) -> dict[Tier, npt.NDArray[np.bool_]]:
        """Which of some tiles each of the better tiers simulates."""
        fine, exact = self.fine[tiles], self.exact[tiles]
        return {"exact": exact, "reference": fine & ~exact}

    def on_patches(self, plane: PatchPlane, device: Device | None) -> CheckCamera:
        """The planned camera on patches, with the draws of the reference, for pairs with it.

        Where the run takes them from the bank, this is not the camera that films: that is
        `bank_on_patches`, whose law is compared. Draws of the bank belong to cycles. An effect that
        is left out moves spikes into other cycles, and with them to other draws, so such spikes
        cannot be paired.
        """
        flags = self._flags_on(plane)
        flags = None if flags is None else flags & np.uint8(~BANK & 255)
        camera = PatchCamera(
            self.setting, plane, self.tier, device if self.tier == "fast" else None, flags
        )
        if not self.fine[plane.tiles].any():
            return camera
        better = self._better(plane.tiles)
        return MixedPatches(camera, self.full.lumped, plane, better, device)

    def banked(self, plane: PatchPlane) -> npt.NDArray[np.bool_]:
        """Which patches take their thresholds from the bank, (patches,)."""
        flags = self._flags_on(plane)
        if flags is None:
            return np.zeros(len(plane.tiles), bool)
        return np.asarray((flags & np.uint8(BANK)).reshape(len(plane.tiles), -1).any(axis=1))

    def bank_on_patches(
        self, plane: PatchPlane, device: Device | None
    ) -> tuple[CheckCamera, CheckCamera]:
        """The planned camera on patches as it films there, with thresholds from the bank, and the
        same without noise of the thresholds. On whole tiles it gives the bits of the run."""
        flags = self._flags_on(plane)
        assert flags is not None  # the fast tier
        quiet = flags & np.uint8(~(BANK | NOISE) & 255)
        bank, noiseless = (
            PatchCamera(self.setting, plane, self.tier, device, each) for each in (flags, quiet)
        )
        return bank, noiseless

    def _flags_on(self, plane: PatchPlane) -> npt.NDArray[np.uint8] | None:
        """Flags of the groups of patches, (rows, 1); None for the exact tier."""
        if self.flags is None:
            return None
        rows = plane.row.reshape(len(plane.tiles), -1)
        columns = np.array(plane.tiles) % self.survey.grid.shape[1]
        return self.flags[rows, columns[:, None]].reshape(-1, 1)


def _noisy(plan: Plan, tiles: int) -> npt.NDArray[np.bool_]:
    """Tiles whose thresholds have noise, (tiles,)."""
    none = np.zeros(tiles, bool)
    return plan.kept.get("shot noise", none) | plan.kept.get("threshold noise", none)


def _banked(plan: Plan, tiles: int) -> npt.NDArray[np.bool_]:
    """Tiles whose thresholds come from the bank in the fast tier, (tiles,)."""
    return _noisy(plan, tiles) & ~plan.kept.get(OWN_DRAWS, np.ones(tiles, bool))


def _flags(plan: Plan, grid: TileGrid, fine: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """Flags of the fast tier, (height, groups) uint8; see `PixelArray`. Its spikes in fine tiles
    are replaced, so they have no effects there."""
    none = np.zeros(len(grid), bool)
    dead = plan.kept.get("reset dead time", none)
    bank = _banked(plan, len(grid))
    flags = NOISE * _noisy(plan, len(grid)) | DEAD_TIME * dead | BANK * bank
    return grid.groups(np.where(fine, 0, flags).astype(np.uint8))


@dataclass(frozen=True, eq=False)
class _Arithmetic:
    """A tier, and the tiles in which it is not good enough.

    Attributes:
        tier: tier of most tiles.
        error: (tiles,) bound of the error of the tier that simulates a tile, relative; in tiles of
            the reference that of a lumped circuit alone.
        fine: (tiles,) bool, tiles that a better tier simulates.
        exact: (tiles,) bool, those of them that the exact tier simulates.
    """

    tier: Tier
    error: npt.NDArray[np.float64]
    fine: npt.NDArray[np.bool_]
    exact: npt.NDArray[np.bool_]

    def cost(self, scene: Summary) -> float:
        """Mean cost of the arithmetic, ns per pixel-cycle."""
        main = EXACT if self.tier == "exact" else QUIET
        better = np.where(self.exact, EXACT, reference_cost(scene))
        return float(np.where(self.fine, better, main).mean())


def _arithmetic(
    setting: CameraSetting,
    scene: Summary,
    tier: Tier,
    tolerance: float,
    mixed: bool,
    behind: Behind | None,
    spans: Sequence[Span],
    banked: npt.NDArray[np.bool_] | None,
) -> _Arithmetic:
    """The arithmetic of a tier, with a better one in the tiles in which it could use more than its
    part of the tolerance: in the exact tier as much as all left-out effects together may use, in
    the fast tier less, as the exact tier can take its place. The exact tier is the better one where
    it is good enough, and the reference elsewhere. In front of a display it is the reference: the
    exact tier simulates such a chip as a whole. banked: see `fast_error`."""
    bound: Callable[[CameraSetting, Summary], npt.NDArray[np.float64]] = exact_error
    if tier == "fast":
        bound = partial(fast_error, banked=banked)
    error = error_over_levels(setting, scene, spans, bound)
    if behind is not None:
        error = error + behind.moved_light(setting, scene, tier, end=False)
    part, most = FAST_PART if tier == "fast" else 1.0, SHARE * accepted_error(tolerance)
    fine = error > part * most if mixed else np.zeros(error.shape, bool)
    exact = np.zeros(error.shape, bool)
    if tier == "fast" and behind is None and fine.any():
        better = error_over_levels(setting, scene, spans, exact_error)
        exact = fine & (better + setting.lumped_error <= most)
        error = np.where(exact, better, error)
    return _Arithmetic(
        tier, np.where(fine & ~exact, 0.0, error) + setting.lumped_error, fine, exact
    )


def plan_camera(
    survey: SceneSurvey,
    setting: CameraSetting,
    tolerance: float,
    spans: Sequence[Span],
    device: Device | None,
    *,
    forced: Sequence[str] = (),
    tier: Tier | None = None,
    behind: Behind | None = None,
    mixed: bool = True,
    draws: Draws = "bank",
) -> CameraPlan:
    """Plans a camera over a scene.

    Args:
        survey: survey of the scene.
        setting: the camera with every effect.
        tolerance: allowed relative error; 0 keeps every effect.
        spans: windows of the images.
        device: OpenCL device, None without one.
        forced: names of effects that are kept for any bound.
        tier: tier of the camera; None to choose it by the tolerance.
        behind: what shows the spikes, whose bounds share the tolerance; None for nothing.
        mixed: whether a better tier simulates the tiles in which the arithmetic of the tier could
            change the rates too much.
        draws: "each" for a draw for each spike in all tiles, "bank" to take thresholds from the
            bank where the tolerance allows.
    """
    scene = survey.scene if behind is None else behind.seen(survey.scene)
    tiers: list[Tier] = ["exact"] if tier is None else [tier]
    if tier is None and device is not None and tolerance > 0 and fast_can_follow(setting, scene):
        tiers.append("fast")
    every = planned_effects(setting, spans)
    with_bank = with_own_draws(every, setting) if draws == "bank" else every
    banked: npt.NDArray[np.bool_] | None = None
    if behind is None and any(effect.name == OWN_DRAWS for effect in with_bank):
        banked = np.ones(len(survey.grid), bool)  # as far as a plan says
    while True:
        found = [
            _arithmetic(setting, scene, each, tolerance, mixed, behind, spans, banked)
            for each in tiers
        ]
        arithmetic = min(found, key=lambda each: each.cost(scene))
        tier, fine = arithmetic.tier, arithmetic.fine
        effects = with_bank
        if tier != "fast":  # the exact tier simulates all tiles with the same effects
            effects = tuple(replace(effect, scope="plane") for effect in every)
        exempt = {effect.name: fine for effect in effects}
        if behind is not None:
            effects += behind.acting_effects
        used = arithmetic.error
        if not mixed:  # a tier whose error exceeds the tolerance wherever effects are kept
            used = np.where(used > SHARE * tolerance, 0.0, used)
        plan = make_plan(
            effects, scene, tolerance, certain=survey.certain, tier_error=used,
            forced=forced, exempt=exempt,
            base_ns=QUIET + (0.0 if behind is None else behind.base_cost),
        )  # fmt: skip
        if banked is None or tier != "fast":
            break
        so_far = fine | _banked(plan, len(banked))
        if so_far[banked].all():
            break
        banked &= so_far
    flags = _flags(plan, survey.grid, fine) if tier == "fast" else None
    coarse = [name for name in exempt if not plan.kept[name][~fine].any()]
    end: npt.NDArray[np.float64] | float = 0.0
    if behind is not None:
        end = np.where(fine, 0.0, behind.moved_light(setting, scene, tier, end=True))
    return CameraPlan(
        plan, survey, tier, setting.without(coarse), flags, arithmetic.error, fine,
        arithmetic.exact, setting, spans, end,
    )  # fmt: skip
