"""The plan of a link's run: tier, effects of the air and of the camera, in units of the bit error
rate's interval.

Every bound begins with the share of a lit pixel's charge in a tick by which leaving the effect out
can move any pixel's charge; `link.air` turns that into the change of the bit error rate over half
the width of its 99.9 % interval, by a closed form that is not the receiver's: so every bound is an
estimate, which the planner counts twice and sums up. The effects' bounds of a rate
(`sensor.effects`) are of images: one spike more or less in a window counts there as a spike, where
a link asks only on which side of the threshold a tick falls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from cosim import Bound, Effect, Summary
from cosim.compute.opencl import Device
from cosim.plan.planner import ESTIMATE_WEIGHT, SHARE, Plan, make_plan
from link.air import Change, LinkSummary, Scene, air_effects, ber, ber_units, link_summary
from link.layout import Layout
from link.mode import Mode
from link.setting import LinkSetting
from link.theory import clopper_pearson
from sensor import CameraSetting
from sensor.latched.effects.costs import QUIET
from sensor.latched.fast import charge_error
from sensor.latched.tiers import Tier

__all__ = [
    "LEVEL", "LinkPlan", "LinkSurvey", "camera_changes", "half_width", "survey_link",
]  # fmt: skip

LEVEL: Final = 0.999
"""Of the bit error rate's interval."""
_DEVIATIONS: Final = 8.0
"""Of a tick's charge, beyond which no threshold decides a bit."""


@dataclass(frozen=True, eq=False)
class LinkPlan:
    """A plan.

    Attributes:
        plan: of every effect.
        scene: what the bounds are computed from.
        tier: of the camera's pixels.
        camera: as it is run.
        of_air: names of the effects of the air that act.
        kept_air: names of those that are simulated.
        own: bound of the error of the tier itself.
    """

    plan: Plan
    scene: LinkSummary
    tier: Tier
    camera: CameraSetting
    of_air: frozenset[str]
    kept_air: frozenset[str]
    own: float

    @property
    def run_air(self) -> frozenset[str] | None:
        """What `link.air.Air` is to keep: None where that is everything."""
        return None if self.kept_air == self.of_air else self.kept_air

    @property
    def kept(self) -> list[str]:
        """Every effect that is simulated."""
        return list(self.plan.everywhere)

    @property
    def left_out(self) -> tuple[str, ...]:
        return self.plan.left_out

    def documents(self, measured: dict[str, float | None] | None = None) -> list[dict[str, Any]]:
        """What is left out, as `result.json` says it. measured: of each, where it was."""
        return [
            {
                "effect": row.effect, "bound": row.bound, "kind": row.kind,
                "measured": (measured or {}).get(row.effect),
            }
            for row in self.plan.rows if row.effect in self.left_out
        ]  # fmt: skip


def half_width(rate: float, bits: int) -> float:
    """Of the 99.9 % Clopper-Pearson interval of a bit error rate met over so many bits: the unit of
    a link's error."""
    low, high = clopper_pearson(round(rate * bits), bits, LEVEL)
    return float(high - low) / 2


def camera_changes(camera: CameraSetting, scene: LinkSummary) -> dict[str, Change]:
    """Of the camera's effects, by name, by how much of a lit pixel's charge in a tick leaving each
    out can move any pixel's. What differs from pixel to pixel is a standard deviation, met anew in
    each."""
    on, q = scene.on, camera.threshold
    tick = float(camera.clock.period)
    shot = q if any(e.name == "shot noise" for e in camera.effects) else 0.0
    noise = math.sqrt(shot + camera.threshold_noise**2) - math.sqrt(shot)
    swing = (scene.on - scene.off) / on
    sizes = {
        # Without it a charge falls on the other side of a threshold up to so many deviations away.
        "shot noise": _DEVIATIONS * math.sqrt(q) / on,
        "threshold noise": _DEVIATIONS * noise / on,
        "row-by-row sampling": swing * camera.row_skew,
        "comparator delay": swing * camera.comparator_delay / tick,
        "reset dead time": camera.dead_time / tick,
        "optical cross-talk": swing * camera.crosstalk,
        "comparator overshoot": abs(camera.overshoot) / on,
        "leak": abs(camera.leak) * tick / on,
    }
    changes = {name: Change(size) for name, size in sizes.items()}
    if camera.pattern is not None:
        own = camera.pattern
        anew = scene.cycles / (camera.chip.width * camera.chip.height)
        changes["PRNU"] = Change(own.prnu, anew)
        changes["threshold FPN"] = Change(own.threshold_fpn, anew)
        dark = own.dark * (1 + _DEVIATIONS * own.dsnu) * tick / on
        changes["dark current and DSNU"] = Change(dark)
    return changes


def _link_effect(effect: Effect, changes: dict[str, Change], lost: float) -> Effect:
    """An effect of the camera with its bound in the link's unit. lost: share of pixels that are hot
    or dead."""

    def bound(summary: Summary) -> Bound:
        if not isinstance(summary, LinkSummary):
            raise TypeError("the bounds of a link's effects need a LinkSummary")
        if effect.name == "hot and dead pixels":  # at worst such a pixel decides a cell
            return Bound(lost / 2 / half_width(ber(summary), summary.bits), "estimate")
        if effect.name not in changes:  # costs nothing, and is kept
            return Bound(math.inf, "proof")
        return Bound(changes[effect.name].units(summary), "estimate")

    return replace(effect, bound=bound, scope="plane")


def _own(camera: CameraSetting, scene: LinkSummary) -> float:
    """What the fast tier's arithmetic may change."""
    error = charge_error(camera.model, scene.on, scene.cycles) * camera.threshold / scene.on
    return ESTIMATE_WEIGHT * ber_units(scene, error)


def _known(effect: Effect, scene: LinkSummary) -> Effect:
    """The same effect with its bound in this scene computed once."""
    bound = effect.bound(scene)
    return replace(effect, bound=lambda _: bound)


@dataclass(frozen=True, eq=False)
class LinkSurvey:
    """What the plans of a link depend on.

    Attributes:
        camera: with every effect.
        scene: what the bounds are computed from.
        of_air, of_camera: effects that act, with their bounds.
        fast: bound of the error of the fast tier's arithmetic.
        lumped: bound of the error of the lumped form of a circuit.
    """

    camera: CameraSetting
    scene: LinkSummary
    of_air: tuple[Effect, ...]
    of_camera: tuple[Effect, ...]
    fast: float
    lumped: float = 0.0

    def plan(
        self,
        tolerance: float,
        device: Device | None,
        *,
        forced: Sequence[str] = (),
        tier: Tier | None = None,
    ) -> LinkPlan:
        """Plans the run.

        Args:
            tolerance: of the change of the bit error rate, half-widths of its interval.
            forced: effects to keep whatever their bound.
            tier: of the camera's pixels; chosen by the tolerance if None.
        """
        if tier is None:
            able = device is not None and tolerance > 0 and self.fast <= SHARE * tolerance / 2
            tier = "fast" if able else "exact"
        own = self.lumped + (self.fast if tier == "fast" else 0.0)
        effects = [*self.of_air, *self.of_camera]
        plan = make_plan(effects, self.scene, tolerance, own=own, forced=forced, base_ns=QUIET)
        gone, acting = set(plan.left_out), frozenset(effect.name for effect in self.of_air)
        return LinkPlan(
            plan, self.scene, tier, self.camera.without(gone), acting, acting - gone, own
        )


def survey_link(setting: LinkSetting, mode: Mode, symbols: int, cycles: int) -> LinkSurvey:
    """The survey of a run.

    Args:
        symbols: that are sent, training included.
        cycles: of the camera.
    """
    camera = setting.camera
    scene_of = Scene(setting.panel, setting.optics, setting.aim, setting.air)
    scene = link_summary(
        scene_of, camera, cell=mode.cell, ticks=mode.ticks, bits=Layout(mode).cells * symbols,
        cycles=cycles,
    )  # fmt: skip
    changes = camera_changes(camera, scene)
    lost = 0.0 if camera.pattern is None else camera.pattern.hot + camera.pattern.dead
    sizes = [_link_effect(effect, changes, lost) for effect in camera.kept]
    return LinkSurvey(
        camera, scene, tuple(_known(e, scene) for e in air_effects(scene_of, camera)),
        tuple(_known(e, scene) for e in sizes), _own(camera, scene),
        ber_units(scene, camera.lumped_error),
    )  # fmt: skip
