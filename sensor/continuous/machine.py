"""The machine of a continuous camera: pixels that report their intensity when it has changed."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from cosim import Clock, Intensities, Light, join_intensities
from cosim.files.intensities import write_intensities
from cosim.plan.error import Finding
from cosim.run.inputs import add_digests
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput, latency_rows, viform_version
from cosim.run.steps import StepChain
from cosim.stage import State
from sensor.continuous.core import Collected
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
    """A continuous camera that is ready to run; see `Machine`. It has one tier and keeps every
    effect."""

    spec: ContinuousSpec

    device = "numba on this processor"
    unit = "cycles"
    bits = 0  # recorded in memory, which has a limit of its own

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
        """None: nothing is left out."""
        return []

    def keep(self, effects: Sequence[str]) -> ContinuousMachine:
        return self

    def chain(self, folder: Path) -> StepChain:
        spec, chip = self.spec, self.spec.setting.chip
        sink = _Sink(
            most=spec.pixels.most,
            shape=(chip.height, chip.width),
            clock=spec.setting.clock,
            light=PixelLight(spec.source.points()[:_DRAWN]),
        )
        return StepChain(
            f"{spec.name}: {chip.width} x {chip.height} continuous pixels", folder,
            spec.setting.clock, spec.cycles, self._steps(sink.light),
            {"sensor": spec.pixels.pixels(), "recorder": sink}, sink,
            hashlib.sha256((add_digests(spec.inputs) + viform_version()).encode()).hexdigest(),
        )  # fmt: skip

    def _steps(self, drawn: PixelLight) -> Iterator[tuple[Light, int, int]]:
        """The light; that of the pixels that are drawn is kept."""
        spec = self.spec
        stop = spec.setting.clock.edge(spec.cycles)
        for light, start, until in spec.pixels.steps(spec.source, spec.relay, spec.cycles):
            drawn.take(light, stop)
            yield light, start, until

    def shortfall(self, recording: Recording) -> list[Finding]:
        """None: no error is measured."""
        return []

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
        return Outcome(
            outcome="degraded" if spec.source.degraded else "ok",
            simulated_s=spec.cycles / clock.hz,
            error=Error(None, "continuous pixels leave nothing out", None),
            kept=list(spec.pixels.error.kept),
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
            notes=[*silent, *spec.source.degraded],
            views=ContinuousViews(reports, sink.light, shots),
        )

    def judged(self, run: Run) -> ContinuousRun:
        """The run as its page reads it."""
        return ContinuousRun(run, self.spec, run.outcome.views)

    def page(self, run: Run) -> Page:
        return continuous_page(self.judged(run))

    def close(self) -> None:
        """Nothing is open."""
