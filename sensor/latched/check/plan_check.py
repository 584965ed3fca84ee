"""The check of a plan: its bounds are measured on a few patches, with common random numbers.

It is a stage between lens and chip. It exposes the patches with several cameras at once: the
reference with every effect, the planned camera, and, in the exact tier, one camera with every
effect and one without each effect that is left out. In all other tiles it exposes a few pixels
(`samples`). The stated error is the largest that was measured; its upper limit is that of the
patches or, if larger, the bound of the plan in the tiles that were not measured as a whole.

Where a run takes thresholds from the bank, its spikes have other noise than those of the reference,
and its error is one of the law. The camera that films the run then films the patches too. Its
distributions are compared with those of the reference (`law`). What else the plan leaves out is
measured by a camera with the draws of the reference, spike by spike; to it is added the distance of
the law of the bank.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.config.amounts import number
from cosim.light.light import Light
from cosim.plan.error import (
    ARITHMETIC,
    CONFIDENCE,
    BrokenPromise,
    Finding,
    Law,
    LawFigure,
    Measured,
    accepted_error,
    beyond,
    reinstated,
)
from cosim.plan.paired import CheckCamera, Paired, Span, Values, Words, compare, worst
from cosim.plan.planner import ESTIMATE_WEIGHT, left_out_rows
from cosim.plan.tiles import TILE, PatchPlane
from cosim.run.result import Error
from cosim.stage import Block
from sensor.latched.bounds import law_of_plan
from sensor.latched.check.law import (
    DOUBT,
    BankChange,
    Intervals,
    Spread,
    bank_change,
    law_change,
)
from sensor.latched.check.samples import TileSamples
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.planning import CameraPlan
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier

_WINDOWS: Final = 8
"""Windows over which the variance of rates is taken, evenly spaced; those of the images are few."""
_SAMPLES: Final = "samples/"
"""Prefix of the state of the samples."""
_INTERVALS: Final = "intervals/"
"""Prefix of the state of latched intervals."""


def absent_on(run: CameraPlan, plane: PatchPlane) -> list[str]:
    """Effects that the plan leaves out in some of these patches."""
    plan = run.plan
    return [name for name in plan.left_out if not plan.kept[name][plane.tiles].all()]


class PlanCheck(Paired):
    """The stage that checks the plan of a camera.

    Args:
        run: the plan that is checked.
        full: the camera with every effect.
        plane: the patches, tiles of the survey's grid.
        device: OpenCL device of the fast tier, None without one.
        samples: samples of other tiles, None without any.
        others: names of effects that are left out and are not those of the camera.
        *more: further arguments of the trial that is checked beside it, see `Paired`.
    """

    def __init__(
        self, run: CameraPlan, full: CameraSetting, plane: PatchPlane, device: Device | None,
        samples: TileSamples | None = None, others: Collection[str] = (), *more: Any,
    ) -> None:  # fmt: skip
        plan = run.plan
        self._promised, self._samples = run.promised, samples
        self._better = {"the exact tier": int(run.exact.sum()), "full physics": run.full_physics}
        self._end_error = run.end_error
        self._plan, self._floor = plan, run.survey.scene.floor
        # The patches of "run" have draws of their own: see `CameraPlan.on_patches`.
        other = {OWN_DRAWS, *others}
        self._left_out = [name for name in absent_on(run, plane) if name not in other]
        cameras: dict[str, CheckCamera] = {
            "reference": PatchCamera(full, plane, "reference"),
            "run": run.on_patches(plane, device),
        }
        if self._left_out:
            cameras["all"] = PatchCamera(full, plane, "exact")
        for name in self._left_out:
            cameras[f"without {name}"] = PatchCamera(full.without([name]), plane, "exact")
        self._of, self._law, self._bank_bound = run.of, law_of_plan(run), run.bank_bound
        self._banked = run.banked(plane)
        self._intervals: dict[str, Intervals] = {}
        if self._banked.any():
            cameras["bank"], cameras["noiseless"] = run.bank_on_patches(plane, device)
            counted = ("reference", "run", "bank")
            many = len(plane.tiles)
            self._intervals = {name: Intervals(many, plane.numbers.size) for name in counted}
        cycles, window = run.survey.scene.cycles, run.survey.scene.window
        self._whole, step = (0, cycles), max(cycles // _WINDOWS, window)
        starts = range(0, cycles - window + 1, step) if self._intervals else ()
        self._apart = [(start, start + window) for start in starts]
        super().__init__(plane, cameras, run.spans, *more, also=[self._whole, *self._apart])

    def step(self, light: Light, block: Block) -> Light:
        if self._samples is not None:
            self._samples.step(light, block)
        return super().step(light, block)

    def filmed(self, name: str, words: Words, start: int, cycles: int) -> None:
        if name in self._intervals:
            self._intervals[name].add(words, start, cycles)
        super().filmed(name, words, start, cycles)

    def reached(self, cycle: int) -> None:
        done = [span for span in self.spans if span[1] == cycle]
        findings = self._broken(done) if done else []
        if findings:
            raise BrokenPromise(findings)

    def _changed(self, name: str, spans: Sequence[Span]) -> Values:
        """Upper limit of the change without the effect, relative, (windows, patches)."""
        truth = self.rates("all", spans)
        return compare(self.rates(f"without {name}", spans), truth, self._floor)[2]

    def _exceeded(self, changes: Mapping[str, Values]) -> list[Finding]:
        """The findings of the effects whose bounds are exceeded on a patch that leaves them out, in
        the patch where it is exceeded most. changes: upper limits, relative, (windows or images,
        patches), by name."""
        findings, tiles = [], np.array(self.plane.tiles)
        for name, high in changes.items():
            promised, absent = self._plan.promise[name][tiles], ~self._plan.kept[name][tiles]
            over = np.where(absent & (high > promised), high / np.maximum(promised, 1e-300), 0)
            if over.any():
                at = np.unravel_index(int(np.argmax(over)), over.shape)
                worst = int(at[1])
                findings.append(
                    reinstated(name, float(promised[worst]), float(high[at]), int(tiles[worst]))
                )
        return findings

    def _broken(self, spans: Sequence[Span]) -> list[Finding]:
        return self._exceeded({name: self._changed(name, spans) for name in self._left_out})

    def broken(self) -> list[Finding]:
        """Exceeded bounds over the whole run."""
        return self._broken(self.spans) + self._broken_by_bank()

    def bank(self) -> BankChange | None:
        """What thresholds from the bank change on the patches that have them, over the windows of
        the run; None if fewer than two have them."""
        if np.count_nonzero(self._banked) < 2:
            return None
        bank, own, noiseless = (
            self.rates(name)[:, self._banked] for name in ("bank", "run", "noiseless")
        )
        return bank_change(bank, own, noiseless, self._floor)

    def _spread(self, name: str) -> Spread:
        """What a camera has filmed on the patches that take the bank."""
        mine = self._banked
        rates = (self.rates(name, self._apart) - self.rates("noiseless", self._apart))[:, mine]
        counts = self._intervals[name].counts[mine]
        return Spread(self.rates(name, [self._whole])[0, mine], rates, counts, self.plane.columns)

    def patches_law(self) -> Law | None:
        """The error in law of the patches that take the bank: of the camera that films there,
        against the reference. None if there are none, and with a single row, whose scatter says
        nothing."""
        return self._law_against("reference", 1 - CONFIDENCE)

    def _law_against(self, other: str, doubt: float) -> Law | None:
        """Change of the law of the camera of the run against that of another one."""
        if not self._banked.any() or self.plane.rows < 2:
            return None
        return law_change(self._spread("bank"), self._spread(other), self._floor, doubt)

    def law(self) -> Law | None:
        """The error in law of the patches, with limits that include what is computed for all tiles
        that take the bank. None for an error of the run."""
        known, found = self._law, self.patches_law()
        if known is None or found is None:
            return known

        def within(figure: LawFigure, promised: LawFigure) -> LawFigure:
            high = max(promised.ci[1], promised.value)
            return figure.within(high, -high)

        return Law(
            within(found.mean, known.mean), within(found.variance, known.variance),
            found.interval_tv.within(known.interval_tv.value),
            within(found.correlation, known.correlation),
        )  # fmt: skip

    def _broken_by_bank(self) -> list[Finding]:
        """The finding if the bank certainly changes the rates by more than its bound, or if the
        intervals or the correlation of its spikes certainly are not those of the bank."""
        change = self.bank()
        if change is None or self._law is None:
            return []
        tiles = np.array(self.plane.tiles)[self._banked]
        promised = np.broadcast_to(self._plan.promise[OWN_DRAWS], len(self._promised))[tiles]
        most, at = float(promised.max()), int(tiles[np.argmax(promised)])
        if change.least > most:
            return [reinstated(OWN_DRAWS, most, change.least, at)]
        found = self._law_against("run", DOUBT)
        if found is None:
            return []
        apart, alike = found.interval_tv, found.correlation
        for least, known in (
            (apart.ci[0], self._law.interval_tv.value),
            (max(alike.ci[0], -alike.ci[1]), self._law.correlation.value),
        ):
            if least > known:
                return [reinstated(OWN_DRAWS, known, least, at)]
        return []

    def patches_error(self) -> Measured:
        """The error of the patches against the reference, of rates."""
        return worst(self.rates("run"), self.rates("reference"), self._floor)

    def errors(self) -> Values:
        """The error of each patch, (windows, patches)."""
        return compare(self.rates("run"), self.rates("reference"), self._floor)[0]

    def _stated(self) -> Measured:
        """The error of the patches. In law, the draws of both cameras were paired; to this is added
        how far the law of the bank is from that of a draw for each spike."""
        change, apart = self.bank(), float(self._bank_bound[self.plane.tiles].max(initial=0.0))
        return self.patches_error().in_law(apart, 0.0 if change is None else change.least)

    def error(self) -> Measured:
        """The error of the run, or in law. The upper limit holds for all tiles: for those that are
        not patches it is their bound. Where a sample exceeds it, the limit is twice the RMS of the
        sample."""
        error, others = self._stated(), self._promised + self._end_error
        others[self.plane.tiles] = 0.0
        least = self._sampled()
        sampled = float(least.max(initial=0.0))
        if self._samples is not None:
            tiles, whole = self._samples.tiles, math.sqrt(TILE**2 / self._samples.pixels)
            others[tiles] = np.where(
                least > others[tiles], ESTIMATE_WEIGHT * whole * least, others[tiles]
            )
        whole_run = error.at_least(sampled, max(sampled, float(others.max(initial=0.0))))
        # Pairs prove nothing of the least distance of two laws.
        return whole_run if self._of == "run" else replace(whole_run, low=error.low)

    def _sampled(self) -> Values:
        """Least error that each sampled tile can have, (tiles of the samples,)."""
        return np.zeros(0) if self._samples is None else self._samples.least_errors()

    def _tiles_over(self) -> int:
        """Number of measured tiles whose error is above the tolerance."""
        limit = accepted_error(self._plan.tolerance)
        return int((self.errors().max(axis=0) > limit).sum() + (self._sampled() > limit).sum())

    def result_error(self) -> Error:
        """The error for `result.json`."""
        error, patches, samples = self.error(), len(self.plane.tiles), self._samples
        kind = f"measured on {patches} patches of {self.plane.numbers.size // patches} pixels"
        checked = patches
        if samples is not None:
            many = "1 pixel" if samples.pixels == 1 else f"{samples.pixels} pixels"
            kind += f" and {many} in each of {samples.tiles.size} other tiles"
            checked += samples.tiles.size
        for tier, count in self._better.items():
            if count:
                kind += f"; {count} of {len(self._promised)} tiles have {tier}"
        if self._of == "law":
            kind += "; in law: with paired draws, and the distance of the bank's own added"
        limits = error.low, error.high
        return Error(error.value, kind, limits, checked, self._tiles_over(), self._of, self.law())

    def measured(self) -> dict[str, float]:
        """Upper limit of the change without each effect that is left out, over the patches that
        leave it out. Of the bank, whose draws are not paired with others, the lower limit."""
        tiles, change = np.array(self.plane.tiles), self.bank()
        bank = {} if change is None else {OWN_DRAWS: change.least}
        return bank | {
            name: float(self._changed(name, self.spans)[:, ~self._plan.kept[name][tiles]].max())
            for name in self._left_out
        }

    def shortfall(self, tier: Tier) -> list[Finding]:
        """Findings if the error of the patches exceeds the tolerance, or that of a sample the bound
        of its tile: the effect whose absence changes the rate most, or the arithmetic of the fast
        tier."""
        error, tolerance = self.patches_error(), self._plan.tolerance
        if tolerance == 0:
            return []
        if error.high <= tolerance:
            stated = self._stated()
            if stated.high > tolerance:  # of the same patches, by the bank
                return [reinstated(OWN_DRAWS, tolerance, stated.high, None)]
            return self._broken_by_bank() or self._broken_in_samples(tier)
        measured = {name: high for name, high in self.measured().items() if name != OWN_DRAWS}
        # Effects that no patch leaves out are not measured; all of them are reinstated then.
        names = (
            [max(measured, key=lambda n: measured[n])]
            if measured
            else [name for name in self._plan.left_out if name != OWN_DRAWS]
        )
        if not names and tier == "fast":
            names = [ARITHMETIC]
        return [reinstated(name, tolerance, error.high, None) for name in names]

    def _broken_in_samples(self, tier: Tier) -> list[Finding]:
        """The finding of the sample that exceeds the bound of its tile most: the effect with the
        largest bound that this tile leaves out, or the arithmetic of the fast tier."""
        if self._samples is None:
            return []
        tiles, least = self._samples.tiles, self._samples.least_errors()
        excess = least / np.maximum(self._promised[tiles], 1e-12)
        if excess.max() <= 1:
            return []
        at, plan = int(np.argmax(excess)), self._plan
        tile = int(tiles[at])
        promises = {
            n: float(plan.promise[n][tile])
            for n in plan.left_out
            if not plan.kept[n][tile] and n != OWN_DRAWS
        }
        if promises:
            name = max(promises, key=lambda n: promises[n])
        elif tier == "fast":
            name = ARITHMETIC
        else:
            return []
        return [reinstated(name, float(self._promised[tile]), float(least[at]), tile)]

    def beyond(self) -> list[str]:
        """A note if the error exceeds the tolerance with every effect kept."""
        error, tolerance = self.error(), self._plan.tolerance
        accepted = accepted_error(tolerance)
        if error.high <= accepted:
            return []
        if float(np.max(self._end_error)) > accepted / 2 and self._stated().high <= accepted:
            return [
                f"the error is {number(error.value, 2)} and may be {number(error.high, 4)}, above "
                f"the tolerance of {number(tolerance)}: spikes may be latched across the end of "
                "the run, whose last plane the observer still sees; make the run longer, or the "
                "images earlier"
            ]
        return [beyond(error, tolerance)]

    def state(self) -> dict[str, npt.NDArray[Any]]:
        state = super().state()
        if self._samples is not None:
            state |= {_SAMPLES + key: value for key, value in self._samples.state().items()}
        for name, each in self._intervals.items():
            state |= {f"{_INTERVALS}{name}/{key}": value for key, value in each.state().items()}
        return state

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        def part(prefix: str) -> dict[str, npt.NDArray[Any]]:
            return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}

        if self._samples is not None:
            self._samples.restore(part(_SAMPLES))
        for name, each in self._intervals.items():
            each.restore(part(f"{_INTERVALS}{name}/"))
        own = _SAMPLES, _INTERVALS
        super().restore({k: v for k, v in state.items() if not k.startswith(own)})

    def full_physics_s(self, pixels: int, cycles: int) -> float | None:
        """Predicted run time of the reference for `pixels` and `cycles`, s, from its time on the
        patches; None if that is unknown."""
        seconds = self.ns("reference") * 1e-9 * pixels * cycles
        return seconds if math.isfinite(seconds) else None

    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json`: effects that at least one tile leaves out, with bound and
        measurement."""
        return left_out_rows(self._plan.absent, self.measured())
