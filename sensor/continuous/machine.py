"""The machine of a continuous camera: pixels that report their intensity when it has changed."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from cosim import Clock, Intensities, Light, join_intensities
from cosim.config.amounts import number
from cosim.files.intensities import write_intensities
from cosim.plan.error import Finding, Measured, accepted_error, beyond
from cosim.run.inputs import add_digests
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput, latency_rows, viform_version
from cosim.run.steps import StepChain
from cosim.stage import State
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.core import Collected
from sensor.continuous.plan import KIND, IntensityPlan, PatchCheck, windows_at
from sensor.continuous.report import continuous_page
from sensor.continuous.run import STREAM, ContinuousRun, ContinuousSpec, ContinuousViews
from sensor.continuous.shots import (
    PixelLight,
    notes_of,
    report_ages,
    report_metrics,
    take_shots,
)
from sensor.reconstruct.fidelity import judge
from sensor.reconstruct.shots import write_images

_METHOD: Final = ("continuous",)
_COLUMNS: Final = ("row", "column", "time", "value")
_DRAWN: Final = 10
"""Pixels whose reports are drawn."""


@dataclass(kw_only=True)
class _Sink(Collected):
    """Collects the reports, with checkpoints.

    Attributes:
        light: light of the pixels drawn.
    """

    shape: tuple[int, int]
    clock: Clock
    light: PixelLight

    def state(self) -> State:
        """The recording so far."""
        if not self.parts:
            return {}
        whole = join_intensities(self.parts)
        self.parts = [whole]
        return {name: getattr(whole, name) for name in _COLUMNS} | {
            "span": np.array([whole.start, whole.ticks])
        }

    def restore(self, state: State) -> None:
        """Go on from a `state`."""
        if state:
            start, ticks = (int(n) for n in state["span"])
            row, column, when, value = (state[name] for name in _COLUMNS)
            self.parts = [
                Intensities(row, column, when, value, self.shape, ticks, self.clock, start)
            ]
            self.count = len(self.parts[0])


@dataclass(frozen=True, eq=False)
class ContinuousMachine:
    """A continuous camera that is planned and ready to run; see `Machine`.

    Attributes:
        spec: camera and scene.
        plan: what is kept.
        light: light that the run begins with.
        steps: light, start and stop (ps) of each step.
    """

    spec: ContinuousSpec
    plan: IntensityPlan
    light: Light
    steps: Iterable[tuple[Light, int, int]]

    device = "numba on this processor"
    unit = "cycles"
    bits = 0  # recorded in memory, which has a limit of its own

    @classmethod
    def begin(cls, spec: ContinuousSpec) -> ContinuousMachine:
        """Takes the first step of light, which the plan is made from."""
        steps = spec.pixels.steps(spec.source, spec.relay, spec.cycles)
        first = next(steps)
        plan = spec.pixels.plan(first[0], spec.setting.clock.edge(spec.cycles))
        return cls(spec, plan, first[0], chain([first], steps))

    @property
    def toml(self) -> str:
        return self.spec.toml

    @property
    def notes(self) -> list[str]:
        spec = self.spec
        notes = notes_of(spec.section, spec.camera, spec.setting, spec.lens, spec.white)
        return [*notes, *spec.source.notes]

    @property
    def length(self) -> int:
        return self.spec.cycles

    def check(self, progress: Progress) -> list[Finding]:
        """None: full physics is filmed beside the run."""
        return []

    def keep(self, effects: Sequence[str]) -> ContinuousMachine:
        if not self.plan.plan.left_out:
            return self
        # What is left out in steady light alone, which is known, is filmed again from the start.
        steps = self.spec.pixels.again(self.light, self.spec.cycles)
        return replace(self, plan=self.plan.keeping(effects), steps=steps)

    def chain(self, folder: Path) -> StepChain:
        spec, chip = self.spec, self.spec.setting.chip
        inputs = add_digests(spec.inputs) + viform_version() + ",".join(self.plan.plan.left_out)
        sink = _Sink(
            most=spec.pixels.most,
            shape=(chip.height, chip.width),
            clock=spec.setting.clock,
            light=PixelLight(spec.source.points()[:_DRAWN]),
        )
        return StepChain(
            f"{spec.name}: {chip.width} x {chip.height} continuous pixels", folder,
            spec.setting.clock, spec.cycles, self._steps(sink.light),
            {
                "check": PatchCheck(self.plan, self.plan.tiles()),
                "sensor": ContinuousCamera(self.plan.planned), "recorder": sink,
            },
            sink, hashlib.sha256(inputs.encode()).hexdigest(),
        )  # fmt: skip

    def _steps(self, drawn: PixelLight) -> Iterator[tuple[Light, int, int]]:
        """The light; that of the pixels that are drawn is kept."""
        spec = self.spec
        stop = spec.setting.clock.edge(spec.cycles)
        for light, start, until in self.steps:
            drawn.take(light, stop)
            yield light, start, until

    def shortfall(self, recording: Recording) -> list[Finding]:
        """What is left out and changes more than its bound."""
        if not self.plan.plan.left_out:
            return []
        reports = join_intensities(recording.chain.sink.parts)
        checked, measured = self._measured(recording, reports)
        return checked.shortfall(measured)

    def _measured(
        self, recording: Recording, reports: Intensities
    ) -> tuple[PatchCheck, list[Measured]]:
        checked: PatchCheck = recording.chain.stages["check"]
        windows = windows_at(self.spec.instants, self.spec.pixels.window, self.spec.cycles)
        return checked, checked.measured(reports, windows)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        spec, seconds, sink = self.spec, recording.seconds, recording.chain.sink
        clock = spec.setting.clock
        begin = time.perf_counter()
        reports = join_intensities(sink.parts)
        write_intensities(reports, recording.folder / STREAM)
        seconds["recorder"] += time.perf_counter() - begin
        begin = time.perf_counter()
        shots = take_shots(reports, spec.source, reports.clock, spec.instants, spec.white)
        metrics = judge(shots, _METHOD)
        files = [STREAM, *write_images(recording.folder, shots, _METHOD)]
        seconds["images"] = time.perf_counter() - begin
        work = reports.shape[0] * reports.shape[1] * spec.cycles
        silent = [
            f"{shot.silent} pixels had not reported by cycle {shot.cycle} and are black in its "
            "image"
            for shot in shots
            if shot.silent
        ]
        rate = work / max(seconds["sensor"], 1e-9)
        checked, found = self._measured(recording, reports)
        error, law = checked.worst(found), self.plan.law
        over = error.high > accepted_error(self.plan.plan.tolerance)
        return Outcome(
            outcome="degraded" if spec.source.degraded or over else "ok",
            simulated_s=spec.cycles / clock.hz,
            error=Error(
                error.value,
                KIND,
                (error.low, error.high),
                len(found),
                checked.over(found),
                "run" if law is None else "law",
                law,
            ),
            kept=self.plan.kept,
            left_out=checked.left_out(found),
            metrics={
                **metrics,
                **report_metrics(reports, spec.setting),
                **getattr(spec.source, "metrics", {}),
                "white_current": Metric(spec.white, "electrons/s"),
                "f_number": Metric(spec.lens.f_number, "1"),
            },
            latency=latency_rows("report age", report_ages(shots, clock)),
            throughput=[Throughput("sensor", rate, "pixel-cycles/s")],
            files=files,
            notes=[*silent, *self._beyond(error), *spec.source.degraded],
            views=ContinuousViews(reports, sink.light, shots),
        )

    def _beyond(self, error: Measured) -> list[str]:
        """What a user must know of an error above the tolerance with everything kept."""
        tolerance = self.plan.plan.tolerance
        if error.high <= accepted_error(tolerance):
            return []
        apart = float(self.plan.apart[1].max())
        if apart < error.high / 2:
            return [beyond(error, tolerance)]
        return [
            f"shot noise is drawn in the limit of many electrons, which differs in law by up to "
            f"{number(apart, 2)} in the darkest tile, where the tolerance is {number(tolerance)}: "
            "a longer time_constant, or measure, lowers it, and so does a larger image.floor"
        ]

    def judged(self, run: Run) -> ContinuousRun:
        """The run as its page reads it."""
        return ContinuousRun(run, self.spec, self.plan, run.outcome.views)

    def page(self, run: Run) -> Page:
        return continuous_page(self.judged(run))

    def close(self) -> None:
        """Nothing is open."""
