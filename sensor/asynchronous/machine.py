"""The machine of an asynchronous camera: pixels that fire when they are full, and their channel."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Final

from cosim import Light
from cosim.config.amounts import percent
from cosim.files import write_events
from cosim.light.steps import light_steps
from cosim.plan.error import Finding, accepted_error
from cosim.run.inputs import add_digests
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput, latency_rows, viform_version
from cosim.run.steps import StepChain
from sensor.asynchronous.plan.check import KIND, Checked, check_plan
from sensor.asynchronous.plan.plan import EventPlan
from sensor.asynchronous.readout.recorder import STREAM, Output
from sensor.asynchronous.readout.recover import dynamic_range, recover, unheard
from sensor.asynchronous.readout.shots import first_instants, take_event_shots
from sensor.asynchronous.report.page import events_page
from sensor.asynchronous.run import EventRun, EventSpec, EventStart, EventViews
from sensor.asynchronous.study import reference_cost
from sensor.reconstruct.fidelity import judge
from sensor.reconstruct.shots import write_images

METHOD: Final = ("tfi",)


@dataclass(eq=False)
class AsynchronousMachine:
    """An asynchronous camera that is planned and ready to run; see `Machine`.

    Attributes:
        spec: camera and scene.
        start: the light that the run begins with.
        rest: the steps of light after it.
        plan: what is kept in which tile.
        spent: wall time before the run, s.
        checked: the plan against the reference, after the check.
    """

    spec: EventSpec
    start: EventStart
    rest: Iterable[tuple[Light, int, int]]
    plan: EventPlan
    spent: dict[str, float]
    checked: Checked | None = field(default=None, init=False)

    device = "numba on this processor"
    unit = "cycles"
    bits = 0  # recorded in memory, which has a limit of its own

    @classmethod
    def begin(cls, spec: EventSpec) -> AsynchronousMachine:
        """Takes the first step of light, which the plan is made from."""
        begin = time.perf_counter()
        steps = light_steps(spec.source, spec.relay, spec.setting.clock, spec.stop)
        light, _, until = next(steps)
        start = EventStart.under(spec, light, until)
        middle = time.perf_counter()
        plan = start.plan(spec.tolerance)
        spent = {"scene": middle - begin, "plan and verification": time.perf_counter() - middle}
        return cls(spec, start, steps, plan, spent)

    @property
    def toml(self) -> str:
        return self.spec.toml

    @property
    def notes(self) -> list[str]:
        return [*self.spec.notes, *self.spec.source.notes]

    @property
    def length(self) -> int:
        return self.spec.cycles

    def check(self, progress: Progress) -> list[Finding]:
        """The plan against the reference on a few tiles."""
        begin = time.perf_counter()
        spec, view = self.spec, self.start.view
        findings, checked = check_plan(self.plan, view, spec.tolerance)
        if checked is not None:
            cost = reference_cost(spec.model, view, self.plan, 1)
            lasts = view.until - view.light.pieces[0].start
            checked = replace(checked, full_physics=cost.seconds * spec.stop / lasts)
        self.spent["plan and verification"] += time.perf_counter() - begin
        self.checked = checked
        return findings

    def keep(self, effects: Sequence[str]) -> AsynchronousMachine:
        return replace(self, plan=self.plan.keeping(effects))

    def chain(self, folder: Path) -> StepChain:
        spec = self.spec
        pixels, output = spec.camera.pixels(self.plan), spec.camera.output(spec.stop)
        height, width = spec.shape
        return StepChain(
            f"{spec.name}: {width} x {height} asynchronous pixels", folder, spec.setting.clock,
            spec.cycles, self._steps(), {"sensor": pixels, "channel": output}, output,
            self._identity(), dict(self.spent),
        )  # fmt: skip

    def _identity(self) -> str:
        """Text that depends on the scenario, its files, what is left out, and the version."""
        text = add_digests(self.spec.inputs) + viform_version()
        return hashlib.sha256(text.encode() + self.plan.left_out.tobytes()).hexdigest()

    def _steps(self) -> Iterator[tuple[Light, int, int]]:
        view = self.start.view
        return chain([(view.light, 0, view.until)], self.rest)

    def shortfall(self, recording: Recording) -> list[Finding]:
        """None: the check has measured the whole error."""
        return []

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        spec, seconds, checked = self.spec, recording.seconds, self.checked
        assert checked is not None
        views = self._views(recording)
        output: Output = recording.chain.sink
        recovered, error = views.recovered, checked.error
        files = [STREAM, *write_images(recording.folder, views.shots, METHOD)]
        beyond = error.high > accepted_error(spec.tolerance)
        fidelity = (
            dynamic_range(recovered, spec.model, spec.stop)
            if recovered
            else judge(views.shots, METHOD)
        )
        delays = [] if views.delay is None else latency_rows("channel", views.delay)
        rate = len(views.sent) / max(seconds["sensor"], 1e-9)
        return Outcome(
            outcome="degraded" if spec.source.degraded or beyond else "ok",
            simulated_s=spec.duration,
            error=Error(
                error.value, KIND, (error.low, error.high), len(checked.tiles), checked.over
            ),
            kept=checked.plan.acting(channel=output.channel is not None),
            left_out=checked.left_out,
            metrics={
                **fidelity,
                **output.metrics(len(views.sent)),
                **getattr(spec.source, "metrics", {}),
                "loop_turns": Metric(float(output.turns), "1"),
                "camera": Metric(seconds["sensor"], "s"),
                "full_physics": Metric(checked.full_physics, "s", "full physics was not timed"),
                "f_number": Metric(spec.lens.f_number, "1"),
            },
            latency=[*latency_rows("first event", first_instants(views.sent)), *delays],
            throughput=[Throughput("sensor", rate, "events/s")],
            files=files,
            notes=[
                *_plan_notes(checked), *spec.source.degraded, *output.losses(), *unheard(recovered)
            ],
            views=views,
        )  # fmt: skip

    def _views(self, recording: Recording) -> EventViews:
        """Writes the stream, and makes images of it and the light of targets."""
        begin = time.perf_counter()
        spec, seconds = self.spec, recording.seconds
        output: Output = recording.chain.sink
        events, sent, leaves = spec.camera.sent(output)
        delay = None if output.channel is None else leaves - sent.instant
        write_events(events, recording.folder / STREAM)
        seconds["recorder"] = time.perf_counter() - begin
        begin = time.perf_counter()
        per_lux = spec.setting.electrons_per_lux
        recovered = recover(
            spec.targets, sent, output.fired, spec.model, spec.stop, spec.lens.gain, per_lux,
            spec.mean_dark,
        )  # fmt: skip
        white = spec.illuminance * spec.lens.gain * per_lux
        shots = take_event_shots(
            events, spec.source, spec.setting.clock, spec.instants, spec.model, white
        )
        seconds["estimates"] = time.perf_counter() - begin
        return EventViews(sent, events, delay, recovered, shots)

    def judged(self, run: Run) -> EventRun:
        """The run as its page reads it."""
        assert self.checked is not None
        return EventRun(run, self.spec, self.checked, run.outcome.views)

    def page(self, run: Run) -> Page:
        return events_page(self.judged(run))

    def close(self) -> None:
        """Nothing is open."""


def _plan_notes(checked: Checked) -> list[str]:
    """How much of the array does without which effect, and what the check found."""
    shares = [f"{row.effect} in {percent(1 - row.kept)}" for row in checked.plan.absent]
    parts = [f"left out, of all pixels: {', '.join(shares)}"] if shares else []
    return [*parts, *checked.notes]
