"""A run with event readout: pixels that speak for themselves, their channel, what is made of it.

The seam is `sensor.asynchronous.EventPixels`: step(light, start, stop) gives the firings of that
time. What those pixels are is theirs: spikes, or absolute intensities on change.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import Events, InputError, Interrupted, seconds_to_ps
from cosim.files import write_events
from cosim.light.lens import Lens
from cosim.light.source import Source, Target
from cosim.run.folder import begin_folder, claimed, output_folder, write_images
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Result, Throughput, latency_rows, write_result
from scenarios.assemble.camera import choose_lens, lens_notes
from scenarios.assemble.event_camera import (
    channel_model,
    event_model,
    event_pixels,
    event_setting,
    with_defaults,
)
from scenarios.assemble.event_plan import kept_names, plan_notes, plan_of, view_of
from scenarios.assemble.loading import to_toml
from scenarios.assemble.readout import (
    AFRESH,
    choose_instants,
    light_steps,
    make_relay,
    refuse_options,
)
from scenarios.assemble.scenario import Scenario
from scenarios.scenes import make_source
from sensor import CameraSetting
from sensor.asynchronous import EventModel, Firings
from sensor.asynchronous.channel import Channel
from sensor.asynchronous.cost import reference_cost
from sensor.asynchronous.output import STREAM, Output, gather_events
from sensor.asynchronous.recover import Recovered, dynamic_range, recover, unheard
from sensor.asynchronous.shots import EventShot, first_instants, take_event_shots
from sensor.asynchronous.verify import KIND, Checked, verify
from sensor.reconstruct.fidelity import judge

__all__ = ["EventRun", "run_events"]


Instants = npt.NDArray[np.int64]


@dataclass
class EventRun:
    """What a run with event readout leaves in memory for its report.

    sent: firings that crossed the channel; events: the same as the file has them. stop: the run's
    end, ps. delay: of each in the channel, ps, None without one. checked: the plan it was run by.
    """

    result: Result
    scenario: Scenario
    folder: Path
    source: Source
    setting: CameraSetting
    model: EventModel
    lens: Lens
    white_rate: float
    events: Events
    sent: Firings
    stop: int
    found: list[Recovered]
    shots: list[EventShot]
    delay: Instants | None
    checked: Checked
    seconds: dict[str, float]
    began: float
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Prepared:
    """A checked run: everything that can be refused has been."""

    name: str
    scenario: Scenario
    setting: CameraSetting
    model: EventModel
    lens: Lens
    white_rate: float
    source: Source
    targets: list[Target]
    instants: list[int]
    output: Output
    notes: list[str]

    @property
    def stop(self) -> int:
        """End of the run, ps."""
        return self.output.stop

    @property
    def cycles(self) -> int:
        """Cycles of sensor.clock, the last one begun."""
        return self.setting.clock.cycle_at(self.stop - 1) + 1


def _prepare(name: str, scenario: Scenario) -> _Prepared:
    setting = event_setting(scenario)
    model = event_model(scenario, setting)
    bus = channel_model(scenario)
    stop = seconds_to_ps(scenario.duration)
    if stop < model.tick:
        raise InputError(
            "duration", f"at least a period of the timing clock, {model.tick} ps", f"{stop} ps",
            "lengthen it",
        )  # fmt: skip
    cycles = setting.clock.cycle_at(stop - 1) + 1
    shape = (setting.chip.height, setting.chip.width)
    lens = choose_lens(scenario, setting)
    white_rate = setting.rate(scenario.scene.illuminance * lens.gain)
    source = make_source(scenario.scene, shape, setting.clock, cycles, aligned=False)
    targets: list[Target] = getattr(source, "targets", [])
    chosen = scenario.sensor.lens.f_number is None
    notes = lens_notes(scenario, lens, white_rate)[:1] if chosen else []  # nothing saturates
    return _Prepared(
        name, scenario, setting, model, lens, white_rate, source, targets,
        [] if targets else choose_instants(scenario, cycles),
        Output(
            None if bus is None else Channel(bus, shape),
            stop,
            shape[0] * shape[1],
            _stamped_late(scenario),
        ),
        [*notes, *source.notes],
    )  # fmt: skip


def _expose(run: _Prepared, progress: Progress) -> tuple[dict[str, float], int, Checked]:
    """Plans, holds the plan against the reference, and runs the chain; seconds of every stage,
    turns of the pixels' loop, and the plan."""
    setting, clock, chip = run.setting, run.setting.clock, run.setting.chip
    progress.start(f"{run.name}: {chip.width} x {chip.height} asynchronous pixels", run.cycles)
    seconds, work = {"scene": 0.0, "plan and verification": 0.0, "sensor": 0.0, "channel": 0.0}, 0
    done, relay = 0, make_relay(run.lens, setting)
    steps = light_steps(run.source, relay, clock, run.stop)
    try:
        last = time.perf_counter()
        first = next(steps)
        begin = time.perf_counter()
        tolerance = run.scenario.tolerance
        plan = plan_of(run.model, setting, first[0], run.stop, tolerance)
        view = view_of(setting, first[0], first[2])
        checked = verify(plan, view, tolerance)
        cost, lasts = reference_cost(run.model, view, checked.plan, 1), view.until - first[1]
        checked = replace(checked, full_physics=cost.seconds * run.stop / lasts)
        pixels = event_pixels(run.scenario, setting, checked.plan)
        end = time.perf_counter()
        seconds["scene"], seconds["plan and verification"] = begin - last, end - begin
        last = end
        for light, start, until in chain([first], steps):
            begin = time.perf_counter()
            firings = pixels.step(light, start, until)
            middle = time.perf_counter()
            run.output.take(firings, until)
            end = time.perf_counter()
            for stage, spent in (
                ("scene", begin - last), ("sensor", middle - begin), ("channel", end - middle)
            ):  # fmt: skip
                seconds[stage] += spent
            last, work = end, work + firings.work
            done = clock.cycle_at(until - 1) + 1
            progress.advance(done)
    except KeyboardInterrupt:
        raise Interrupted(done, run.cycles, AFRESH) from None
    return seconds, work, checked


def _make_result(
    run: _Prepared, sent: Firings, delay: Instants | None, found: list[Recovered],
    shots: list[EventShot], checked: Checked, seconds: dict[str, float], work: int,
) -> Result:  # fmt: skip
    error = checked.error
    beyond = run.scenario.tolerance > 0 and error.high > run.scenario.tolerance
    return Result(
        scenario=run.name,
        outcome="degraded" if run.source.degraded or beyond else "ok",
        seed=run.scenario.seed,
        device="numba on this processor",
        simulated_s=run.scenario.duration,
        tolerance=run.scenario.tolerance,
        error=Error(error.value, KIND, (error.low, error.high)),
        kept=kept_names(checked.plan, delay is not None),
        left_out=checked.left_out,
        metrics={
            **(dynamic_range(found, run.model, run.stop) if found else judge(shots, ("tfi",))),
            **run.output.metrics(len(sent)),
            "loop_turns": Metric(float(work), "1"),
            "camera": Metric(seconds["sensor"], "s"),
            "full_physics": Metric(checked.full_physics, "s"),
            "f_number": Metric(run.lens.f_number, "1"),
        },
        latency=[
            *latency_rows("first event", first_instants(sent)),
            *(latency_rows("channel", delay) if delay is not None else []),
        ],
        throughput=[Throughput("sensor", len(sent) / max(seconds["sensor"], 1e-9), "events/s")],
        files=["scenario.toml", STREAM],
    )


def run_events(
    name: str,
    scenario: Scenario,
    out: Path | None,
    *,
    resume: bool = False,
    device: str | None = None,
    progress: Progress,
    began: float,
    report: Callable[[EventRun], list[str]],
) -> tuple[Result, Path]:
    """Runs a scenario with asynchronous readout and writes its folder, `result.json` last.

    began: time.perf_counter() at the command's start. report: writes figures and report.html and
    returns their names. An interrupted run leaves no result.json and is run afresh.
    Raises InputError for input that cannot be used, Interrupted.
    """
    refuse_options("asynchronous", resume, device)
    output_folder(name, out, False)
    scenario = with_defaults(scenario)
    run = _prepare(name, scenario)
    with claimed(name, out, False, goes_on=False) as folder:
        begin_folder(folder, to_toml(scenario))
        for note in run.notes:
            progress.note(note)
        seconds, work, checked = _expose(run, progress)
        try:
            begin = time.perf_counter()
            sent, leaves = run.output.crossed()
            delay = None if run.output.channel is None else leaves - sent.instant
            stamps = leaves if run.output.late else sent.instant
            shape = (run.setting.chip.height, run.setting.chip.width)
            events = gather_events(sent, stamps, run.model, shape, run.stop)
            write_events(events, folder / STREAM)
            seconds["recorder"] = time.perf_counter() - begin
            begin = time.perf_counter()
            device_pattern, per_lux = run.setting.pattern, run.setting.electrons_per_lux
            found = recover(
                run.targets, sent, run.output.spoke, run.model, run.stop, run.lens.gain, per_lux,
                0.0 if device_pattern is None else device_pattern.dark,
            )  # fmt: skip
            white = scenario.scene.illuminance * run.lens.gain * per_lux
            shots = take_event_shots(
                events, run.source, run.setting.clock, run.instants, run.model, white
            )
            seconds["estimates"] = time.perf_counter() - begin
            result = _make_result(run, sent, delay, found, shots, checked, seconds, work)
            result.files += write_images(folder, shots, ("tfi",))
            warnings = [
                *plan_notes(checked), *run.source.degraded, *run.output.losses(), *unheard(found)
            ]  # fmt: skip
            for note in warnings:
                progress.note(note)
            result.files += report(EventRun(
                result, scenario, folder, run.source, run.setting, run.model, run.lens,
                run.white_rate, events, sent, run.stop, found, shots, delay, checked, seconds,
                began, [*run.notes, *warnings],
            ))  # fmt: skip
            result.files.append("result.json")
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
        except KeyboardInterrupt:
            raise Interrupted(run.cycles, run.cycles, AFRESH) from None
    return result, folder


def _stamped_late(scenario: Scenario) -> bool:
    """Whether t is taken as an event leaves the channel."""
    return scenario.sensor.channel is not None and scenario.sensor.channel.timestamp == "channel"
