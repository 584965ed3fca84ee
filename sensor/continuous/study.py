"""A continuous camera that is planned and measured without a run: what a run would keep and leave
out, and error against run time over a ladder of tolerances.

A cycle is one of sensor.clock. The ladder films the light that a run begins with, as far as that is
known and at most `_CYCLES`, with the tiles of all plans; the time is that of the pixels alone, one
call discarded, the least of the rest.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, Final

import numpy as np

from cosim import Intensities, Light, join_intensities
from cosim.plan.error import Measured
from cosim.plan.study import REFERENCE, Speeds, Step, climb, ladder_document, plan_document
from cosim.run.progress import Progress
from cosim.run.timing import least
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.core import Collected
from sensor.continuous.plan import IntensityPlan, PatchCheck, windows_at
from sensor.continuous.run import ContinuousSpec

_CYCLES: Final = 640
"""Cycles of a ladder."""
_BRIEF: Final = 64
"""Cycles on which a forecast is timed."""
_CALLS: Final = 3
"""Timed calls."""
_ENOUGH: Final = 5.0
"""Seconds of repeated calls after which no more are made."""
_OWN: Final = 1e-9
"""Error of the reference: a few roundings of float64 in sums of its nodes, and in quantiles."""


class ContinuousStudy:
    """See `Study`."""

    def __init__(self, spec: ContinuousSpec) -> None:
        self.spec = spec
        self._steps: list[tuple[Light, int, int]] = []
        self._cycles = 0

    def _take(self, most: int) -> None:
        """The light of the first cycles, at most so many."""
        spec, clock = self.spec, self.spec.setting.clock
        self._cycles = min(most, spec.cycles)
        last = clock.edge(self._cycles)
        for light, start, stop in spec.pixels.steps(spec.source, spec.relay, spec.cycles):
            self._steps.append((light, start, min(stop, last)))
            if stop >= last:
                return

    def _plan(self, tolerance: float) -> IntensityPlan:
        spec = self.spec
        stop = spec.setting.clock.edge(spec.cycles)
        return spec.pixels.plan(self._steps[0][0], stop, tolerance=tolerance)

    def _film(self, plan: IntensityPlan) -> Intensities:
        pixels, collected = ContinuousCamera(plan.planned), Collected(self.spec.pixels.most)
        for light, start, stop in self._steps:
            collected.step(pixels.step(light, start, stop), start, stop)
        return join_intensities(collected.parts)

    @property
    def _size(self) -> float:
        """Pixel-cycles of the steps."""
        chip = self.spec.setting.chip
        return float(chip.height * chip.width * self._cycles)

    def _ns(self, plan: IntensityPlan) -> float:
        """Nanoseconds a pixel-cycle."""
        return least(lambda: self._film(plan), _CALLS, _ENOUGH) * 1e9 / self._size

    def forecast(self, progress: Progress) -> dict[str, Any]:
        """What a run would keep and leave out, and how long the pixels would take."""
        spec = self.spec
        self._take(_BRIEF)
        plan, full = self._plan(spec.pixels.tolerance), self._plan(0.0)
        whole = self._size * spec.cycles / self._cycles
        ns = self._ns(plan)
        every = self._ns(full) if plan.plan.left_out else ns
        bounds = plan.bounds()
        law = None if bounds.law is None else bounds.law.document()
        return plan_document(
            spec.name, plan.plan.tolerance, plan.rows,
            tier="fast" if plan.plan.left_out else "exact", device="numba on this processor",
            predicted=Speeds(ns, every, None, None).document(whole),
            promised=bounds.bound, promised_kind=bounds.kind,
            error={"of": bounds.of, "law": law},
        )  # fmt: skip

    def ladder(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform accuracy`: the camera with all effects is the tier "exact", that
        without shot noise "fast"."""
        spec = self.spec
        self._take(_CYCLES)
        rungs = climb(["exact"], lambda tier, tolerance: self._plan(tolerance),
                      lambda plan: plan.plan.left_out)  # fmt: skip
        progress.start("accuracy of continuous pixels", len(rungs) + 1)
        tiles = sorted({tile for rung in rungs for tile in rung.plan.tiles()})
        full = rungs[0].plan
        begin = time.perf_counter()
        check = PatchCheck(full, tiles)
        for light, start, stop in self._steps:
            check.step(light, start, stop)
        pixels = sum(np.prod(np.diff(np.reshape(full.grid.box(t), (2, 2)))) for t in tiles)
        reference_ns = (time.perf_counter() - begin) * 1e9 / (float(pixels) * self._cycles)
        progress.advance(1)
        half = spec.pixels.window // 2
        at = [n for n in spec.instants if n + half < self._cycles] or [self._cycles // 2]
        windows = windows_at(at, spec.pixels.window, self._cycles)
        steps: list[Step] = []
        whole = self._size * spec.cycles / self._cycles
        for n, rung in enumerate(rungs):
            left = rung.plan.plan.left_out
            check.plan = rung.plan
            error = check.worst(check.measured(self._film(rung.plan), windows))
            rung = replace(rung, tier="fast" if left else "exact")
            of = rung.plan.bounds().of
            steps += rung.steps(error, self._ns(rung.plan), whole, rung.plan.kept, left, of)
            progress.advance(n + 2)
        steps.append(Step.measured(
            REFERENCE, None, Measured(_OWN, 0.0, _OWN), reference_ns, whole, full.kept
        ))  # fmt: skip
        reference = {
            "what": "the same equations in float64 on a few tiles: integrals of the light over "
            "Gauss-Legendre nodes, scipy's normal quantiles at the same random words, crossings "
            "by bisection; the error in law adds the distance from single electrons",
            "error": _OWN, "error_is": "roundings of float64",
            "run_time_s": reference_ns * whole * 1e-9, "ns_per_pixel_cycle": reference_ns,
        }  # fmt: skip
        return ladder_document(steps, reference, _OWN, None)
