"""The plan of a link's run: tier and effects, bounded in half-widths of the bit error rate's
interval.

Every bound starts from the share of a lit pixel's charge in a tick by which leaving the effect out
can change any pixel's charge. `link.air` converts it to the change of the bit error rate over half
the width of its 99.9 % interval, by a closed form that is not the receiver's. Every bound is
therefore an estimate, which the planner counts twice and adds up. The bounds of
`sensor/latched/effects` do not apply: they are for images, where one spike more in a window counts
as a spike, while a link only reads on which side of the threshold a tick falls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from cosim import Bound, Effect, Summary
from cosim.compute.opencl import Device
from cosim.plan.error import CONFIDENCE
from cosim.plan.planner import ESTIMATE_WEIGHT, SHARE, Plan, make_plan
from link.air import Change, LinkSummary, Scene, air_effects, ber, ber_units, link_summary
from link.air.effects import charge_changes
from link.layout import Layout
from link.mode import Mode
from link.setting import LinkSetting
from link.theory.intervals import NORMAL, clopper_pearson
from sensor import CameraSetting
from sensor.latched.effects.effect import QUIET
from sensor.latched.fast import charge_error
from sensor.latched.tiers import Tier

NEARLY: Final = 1e-3
"""Share of the bits that are nearly wrong."""
_DEVIATIONS: Final = 8.0
"""Standard deviations of a tick's charge beyond which no threshold decides a bit."""
_NOISES: Final = frozenset({"shot noise", "threshold noise", "row timing noise", "common drift"})
"""Effects of the camera that only scatter charges."""


@dataclass(frozen=True, eq=False)
class LinkPlan:
    """The plan of a link.

    Attributes:
        plan: plan of every effect.
        scene: input of the bounds.
        tier: tier of the camera's pixels.
        camera: camera with the effects that are simulated.
        active_air: names of the effects of the air that act in the scene.
        simulated_air: names of those that are simulated.
        tier_bound: bound of the error of the tier itself.
    """

    plan: Plan
    scene: LinkSummary
    tier: Tier
    camera: CameraSetting
    active_air: frozenset[str]
    simulated_air: frozenset[str]
    tier_bound: float

    @property
    def air_effects(self) -> frozenset[str] | None:
        """Effects for `link.air.Air`: None for all."""
        return None if self.simulated_air == self.active_air else self.simulated_air

    @property
    def simulated(self) -> list[str]:
        """Every effect that is simulated."""
        return list(self.plan.everywhere)

    @property
    def left_out(self) -> tuple[str, ...]:
        return self.plan.left_out

    @property
    def promised(self) -> float:
        """Bound of the error of this plan over all cells, as a bit error rate."""
        unit = half_width(ber(self.scene), self.scene.bits)
        return float(np.max(self.plan.total + self.tier_bound)) * unit


def half_width(rate: float, bits: int) -> float:
    """Half the 99.9 % Clopper-Pearson interval of a bit error rate, the unit of a link's error.

    Args:
        rate: bit error rate.
        bits: number of bits that it was measured over.
    """
    low, high = clopper_pearson(round(rate * bits), bits, CONFIDENCE)
    return float(high - low) / 2


def camera_changes(camera: CameraSetting, scene: LinkSummary) -> dict[str, Change]:
    """Change of a pixel's charge without each effect of the camera, by name.

    Changes are shares of a lit pixel's charge in a tick. A change that differs from pixel to pixel
    is a standard deviation, drawn once for each pixel.
    """
    on, q = scene.on, camera.threshold
    tick = float(camera.clock.period)
    shot = q if any(e.name == "shot noise" for e in camera.effects) else 0.0
    noise = math.sqrt(shot + camera.threshold_noise**2) - math.sqrt(shot)
    swing = (scene.on - scene.off) / on
    sizes = {
        # Without it, a charge within so many deviations may fall on the other side of a threshold.
        "shot noise": _DEVIATIONS * math.sqrt(q) / on,
        "threshold noise": _DEVIATIONS * noise / on,
        "row-by-row sampling": swing * camera.row_skew,
        "comparator delay": swing * camera.comparator_delay / tick,
        "row timing noise": swing * _DEVIATIONS * _moved(camera),
        "common drift": _DEVIATIONS * camera.drift,
        "reset dead time": camera.dead_time / tick,
        "optical cross-talk": swing * camera.crosstalk,
        "comparator overshoot": abs(camera.overshoot) / on,
        "leak": abs(camera.leak) * tick / on,
    }
    changes = {name: Change(size) for name, size in sizes.items()}
    if camera.pattern is not None:
        pattern = camera.pattern
        duration = scene.cycles / (camera.chip.width * camera.chip.height)  # one draw a pixel
        changes["PRNU"] = Change(pattern.prnu, duration)
        changes["threshold FPN"] = Change(pattern.threshold_fpn, duration)
        lines = math.hypot(pattern.rows, pattern.columns)
        changes["row and column FPN"] = Change(lines, duration)
        dark = pattern.dark * (1 + _DEVIATIONS * pattern.dsnu) * tick / on
        changes["dark current and DSNU"] = Change(dark)
    return changes


def _moved(camera: CameraSetting) -> float:
    """Largest RMS of the sampling instants of a pixel, cycles."""
    noise = camera.row_timing
    return 0.0 if noise is None else math.hypot(noise.jitter, noise.slow)


def _link_effect(effect: Effect, changes: dict[str, Change], lost: dict[str, float]) -> Effect:
    """An effect of the camera with its bound in half-widths.

    Args:
        effect: the effect.
        changes: changes of all effects, by name.
        lost: share of pixels that each effect of defects makes useless, by name.
    """

    def bound(summary: Summary) -> Bound:
        if not isinstance(summary, LinkSummary):
            raise TypeError("the bounds of a link's effects need a LinkSummary")
        if effect.name in lost:  # worst case: such a pixel decides a cell
            share = lost[effect.name]
            return Bound(share / 2 / half_width(ber(summary), summary.bits), "estimate")
        if effect.name not in changes:  # costs nothing, and is kept
            return Bound(math.inf, "proof")
        return Bound(changes[effect.name].units(summary), "estimate")

    return replace(effect, bound=bound, scope="plane")


def _fast_error(camera: CameraSetting, scene: LinkSummary) -> float:
    """Bound of the error of the fast tier's arithmetic."""
    error = charge_error(camera.model, scene.on, scene.cycles) * camera.threshold / scene.on
    return ESTIMATE_WEIGHT * ber_units(scene, error)


@dataclass(frozen=True, eq=False)
class LinkSurvey:
    """Input of the plans of a link.

    Attributes:
        camera: camera with every effect.
        scene: input of the bounds.
        air_effects, camera_effects: effects that act, with their bounds.
        fast: bound of the error of the fast tier's arithmetic.
        lumped: bound of the error of the lumped form of a circuit.
        unclear: standard deviation of the check's result for each effect of the air that is left
            out, half-widths (`uncertainty`); empty if the plan is not checked.
    """

    camera: CameraSetting
    scene: LinkSummary
    air_effects: tuple[Effect, ...]
    camera_effects: tuple[Effect, ...]
    fast: float
    lumped: float = 0.0
    unclear: Mapping[str, float] = field(default_factory=dict)

    def plan(
        self,
        tolerance: float,
        device: Device | None,
        *,
        forced: Sequence[str] = (),
        tier: Tier | None = None,
    ) -> LinkPlan:
        """Plans the run.

        An effect whose absence the check cannot tell from nothing is kept, whatever its bound: the
        error that the run reports would be the chance of the check.

        Args:
            tolerance: Limit of the change of the bit error rate, half-widths of its interval.
            device: OpenCL device, None for numba.
            forced: effects to simulate whatever their bound.
            tier: tier of the camera's pixels; None to choose it by the tolerance.
        """
        if tier is None:
            able = device is not None and tolerance > 0 and self.fast <= SHARE * tolerance / 2
            tier = "fast" if able else "exact"
        bound = self.lumped + (self.fast if tier == "fast" else 0.0)
        effects = [*self.air_effects, *self.camera_effects]
        forced = [*forced, *(n for n, size in self.unclear.items() if size > SHARE * tolerance)]
        plan = make_plan(
            effects, self.scene, tolerance, tier_error=bound, forced=forced, base_ns=QUIET
        )
        left_out, active = set(plan.left_out), frozenset(effect.name for effect in self.air_effects)
        return LinkPlan(
            plan, self.scene, tier, self.camera.without(left_out), active, active - left_out, bound
        )


@dataclass(frozen=True)
class Compared:
    """What the check of a plan will compare.

    Attributes:
        bits: number of bits on its patches.
        rate: their bit error rate as far as it is known, from pilots; None for the closed form of
            the bounds.
    """

    bits: int
    rate: float | None = None


def uncertainty(scene: LinkSummary, size: float, spikes: float, compared: Compared) -> float:
    """Standard deviation of a check of an effect that changes nothing on average, in half-widths of
    the run's bit error rate.

    The check counts bits that are nearly wrong, a share of all (`link.plan.check`). The charges of
    such a bit are near the threshold Q. A change of a charge by the share s moves its spike, where
    noise gives the charge a normal density of deviation n Q at the threshold, with the chance
    |s| / (n sqrt(2 pi)), and for a normal s of deviation `size` with size / (pi n). That share of
    the nearly wrong bits comes or goes at random, and its number in `compared.bits` has the spread
    of its root. The run is longer than the check: in half-widths, the spread grows with the root of
    (bits of the run / bits of the check). In a run of `light-link` with 4 MB, 28 of 4701 such bits
    came or went; this gives 26.

    Args:
        scene: the link.
        size: standard deviation of s.
        spikes: number of spikes that decide a bit: pixels of a cell times ticks that its symbol
            lights.
        compared: bits and rate that the check will compare.
    """
    rate = ber(scene) if compared.rate is None else compared.rate
    wrong = max(rate * scene.bits, 1.0)
    noise = math.sqrt(scene.threshold + scene.noise**2) / scene.threshold  # as a share of Q
    moved = min(spikes * size / noise / math.pi, 1.0)
    near = max(NEARLY, rate) * compared.bits
    return math.sqrt(moved / near) * math.sqrt(wrong) / NORMAL


def _by_pilots(
    scene: LinkSummary, changes: Mapping[str, Change], spikes: float, compared: Compared | None
) -> dict[str, float]:
    """Change of the bit error rate without each constant effect, in half-widths, from the error
    rate of pilots; empty without them.

    The closed form of `ber` has a few pixels in whole ticks, and can be orders below the rate of a
    receiver, whose half-width is then larger in errors, but smaller in shares. The charges of a bit
    that is wrong are near the threshold Q, with a density of deviation n Q as in `uncertainty`. The
    mean of N charges has the deviation n Q / sqrt(N). A constant change of all of them by the share
    s of Q therefore moves a share sqrt(N) s / (n sqrt(2 pi)) of such bits. Without errors among the
    pilots, the rate is that of a single error in the run, as in the check. Leaving out a noise at
    most takes all errors away.

    Without ambient light on the panel, s is .0088 and 15 % of the errors of `link-chosen` (2 x 2)
    came or went in four checks; this gives 31 %. In a file of 64 KiB (3 x 3), 38 % of the nearly
    wrong bits went in eight; this gives 47 %.

    Args:
        scene: the link.
        changes: change of each effect, by name.
        spikes: N, that decide a bit, as in `uncertainty`.
        compared: bits and rate that the check will compare.
    """
    if compared is None or compared.rate is None:
        return {}
    rate = max(compared.rate, 1 / scene.bits)
    each = rate / half_width(rate, scene.bits)
    spread = math.hypot(math.sqrt(scene.threshold), scene.noise) * math.sqrt(2 * math.pi)
    shares = {
        name: math.sqrt(spikes) * change.size * scene.on / spread
        for name, change in changes.items()
        if change.law is None and change.duration == 0 and change.size > 0
    }
    return {name: each * (min(s, 1.0) if name in _NOISES else s) for name, s in shares.items()}


def _at_least(effect: Effect, scene: LinkSummary, floor: Mapping[str, float]) -> Effect:
    """The same effect with its bound in this scene computed once, at least the floor."""
    bound = effect.bound(scene)
    if effect.name in floor and math.isfinite(bound.value):
        bound = replace(bound, value=max(bound.value, floor[effect.name]))
    return replace(effect, bound=lambda _: bound)


def survey_link(
    setting: LinkSetting, mode: Mode, symbols: int, cycles: int, compared: Compared | None = None
) -> LinkSurvey:
    """Surveys a run.

    Args:
        setting: the link.
        mode: mode of the transmission.
        symbols: number of symbols sent, training included.
        cycles: number of cycles of the camera.
        compared: bits and rate that the check will compare; None without a check.
    """
    camera = setting.camera
    scene_of = Scene(setting.panel, setting.optics, setting.aim, setting.air)
    scene = link_summary(
        scene_of, camera, cell=mode.cell, ticks=mode.ticks, bits=Layout(mode).cells * symbols,
        cycles=cycles,
    )  # fmt: skip
    changes = camera_changes(camera, scene)
    lost = {}
    if camera.pattern is not None:
        defect = camera.pattern.hot + camera.pattern.dead
        lost = {"hot and dead pixels": defect, "warm pixels": camera.pattern.warm}
    sizes = [_link_effect(effect, changes, lost) for effect in camera.acting_effects]
    spikes = max((mode.cell * setting.scale) ** 2, 1.0) * (mode.ticks + 1)
    unclear = {}
    if compared is not None and compared.bits:
        unclear = {
            name: uncertainty(scene, change.size, spikes, compared)
            for name, change in charge_changes(scene_of, camera).items() if change.law is not None
        }  # fmt: skip
    every = charge_changes(scene_of, camera) | changes
    by_pilots = _by_pilots(scene, every, spikes, compared)
    return LinkSurvey(
        camera, scene, tuple(_at_least(e, scene, by_pilots) for e in air_effects(scene_of, camera)),
        tuple(_at_least(e, scene, by_pilots) for e in sizes), _fast_error(camera, scene),
        ber_units(scene, camera.lumped_error), unclear,
    )  # fmt: skip
