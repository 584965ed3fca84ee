"""A run with the continuous readout: pixels that report their absolute intensity as it changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from cosim import (
    BLOCK,
    PS,
    InputError,
    Intensities,
    Interrupted,
    join_intensities,
    seconds_to_ps,
)
from cosim.files.intensities import write_intensities
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.run.folder import begin_folder, claimed, output_folder, write_images
from cosim.run.progress import Progress
from cosim.run.result import Metric, Result, Throughput, latency_rows, write_result
from scenarios.assemble.camera import choose_lens
from scenarios.assemble.continuous import continuous_camera, continuous_setting, with_defaults
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
from sensor.continuous import ContinuousCamera, ContinuousSetting
from sensor.continuous.shots import (
    ContinuousShot,
    PixelLight,
    effect_names,
    notes_of,
    report_ages,
    report_metrics,
    take_shots,
)
from sensor.reconstruct.fidelity import judge
from sensor.sections.sensor import SPIKING

__all__ = ["STREAM", "ContinuousRun", "run_continuous"]

STREAM = "stream.intensities.npz"
"""The reports' name in a run's folder."""
METHOD = ("continuous",)
SHOWN = 10
"""Pixels whose reports are drawn."""


@dataclass
class ContinuousRun:
    """What a run with the continuous readout leaves in memory for its report. white: electrons a
    second of white. light: of the pixels that are drawn."""

    result: Result
    scenario: Scenario
    folder: Path
    source: Source
    camera: CameraSetting
    setting: ContinuousSetting
    lens: Lens
    white: float
    reports: Intensities
    shots: list[ContinuousShot]
    light: PixelLight
    seconds: dict[str, float]
    began: float
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Prepared:
    """A checked run: everything that can be refused has been. most: cycles of a step."""

    name: str
    scenario: Scenario
    camera: CameraSetting
    setting: ContinuousSetting
    lens: Lens
    source: Source
    cycles: int
    most: int
    most_reports: int
    instants: list[int]

    @property
    def white(self) -> float:
        """Electrons a second of white."""
        lux = self.scenario.scene.illuminance * self.lens.gain
        return lux * self.setting.electrons_per_lux


def _longest_step(setting: ContinuousSetting, cycles: int) -> int:
    """Cycles of a step: blocks with noise, whose reports may be many; else as many as the exact
    arithmetic of its ticks has room for."""
    if setting.noise:
        return BLOCK
    room = 2**60 // (PS * setting.clock.den)
    if not room:
        raise InputError(
            "sensor.clock", "a frequency of fewer digits without shot noise",
            f"{setting.clock.num}/{setting.clock.den} Hz", "round it",
        )  # fmt: skip
    return min(cycles, room)


def _prepare(name: str, scenario: Scenario) -> _Prepared:
    section = scenario.sensor.continuous
    assert section is not None
    camera = continuous_camera(scenario)
    setting = continuous_setting(section, camera)
    clock, chip = setting.clock, setting.chip
    cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
    if not cycles:
        raise InputError(
            "duration", f"at least a cycle, {float(clock.period):g} s", f"{scenario.duration:g} s",
            "lengthen it",
        )  # fmt: skip
    instants = choose_instants(scenario, cycles)
    lens = choose_lens(scenario, camera)
    source = make_source(scenario.scene, (chip.height, chip.width), clock, cycles, aligned=False)
    return _Prepared(
        name, scenario, camera, setting, lens, source, cycles, _longest_step(setting, cycles),
        section.most_reports, instants,
    )  # fmt: skip


def _early_notes(run: _Prepared) -> list[str]:
    """What is known before the run."""
    sensor, notes = run.scenario.sensor, []
    if sensor.lens.f_number is None:
        notes.append(
            f"f/{run.lens.f_number:.3g}, with which white would fire at "
            f"{sensor.lens.white_rate:.3g} a cycle in a spike camera of "
            f"{run.camera.threshold:g} e; nothing else here has that threshold"
        )
    if sensor.preset == "silicon":
        spiking = ", ".join(name.replace("_", " ") for name in SPIKING)
        notes.append(f"left out of the preset silicon, since no pixel spikes: {spiking}")
    if not run.setting.noise:
        notes.append("shot noise is off")
    notes.append(
        "nothing is left out, and there is no second tier of these pixels to measure an error by"
    )
    return [*notes, *notes_of(run.setting, run.white), *run.source.notes]


def _expose(
    run: _Prepared, light: PixelLight, progress: Progress
) -> tuple[Intensities, dict[str, float]]:
    """Runs the chain; all reports, and seconds of every stage."""
    clock, chip = run.setting.clock, run.setting.chip
    progress.start(f"{run.name}: {chip.width} x {chip.height} continuous pixels", run.cycles)
    seconds, stop = {"scene": 0.0, "sensor": 0.0}, clock.edge(run.cycles)
    pixels, relay = ContinuousCamera(run.setting), make_relay(run.lens, run.camera)
    parts: list[Intensities] = []
    count = done = 0
    last = time.perf_counter()
    try:
        for given, start, until in light_steps(run.source, relay, clock, stop, run.most):
            light.take(given, stop)
            begin = time.perf_counter()
            parts.append(pixels.step(given, start, until))
            end = time.perf_counter()
            seconds["scene"] += begin - last
            seconds["sensor"] += end - begin
            last, done = end, clock.cycle_at(until)
            count += len(parts[-1])
            if count > run.most_reports:
                raise InputError(
                    "the reports", f"at most {run.most_reports:,}", "more",
                    "shorten duration, simulate fewer pixels, or raise sensor.continuous.contrast, "
                    "floor or most_reports",
                )  # fmt: skip
            progress.advance(done)
    except KeyboardInterrupt:
        raise Interrupted(done, run.cycles, AFRESH) from None
    return join_intensities(parts), seconds


def _make_result(
    run: _Prepared, reports: Intensities, shots: list[ContinuousShot], seconds: dict[str, float]
) -> Result:
    clock = run.setting.clock
    work = reports.shape[0] * reports.shape[1] * run.cycles
    return Result(
        scenario=run.name,
        outcome="degraded" if run.source.degraded else "ok",
        seed=run.scenario.seed,
        device="numba on this processor",
        simulated_s=run.cycles / clock.hz,
        tolerance=run.scenario.tolerance,
        kept=effect_names(run.setting, run.camera),
        metrics={
            **judge(shots, METHOD),
            **report_metrics(reports, run.setting),
            "white_current": Metric(run.white, "electrons/s"),
            "f_number": Metric(run.lens.f_number, "1"),
        },
        latency=latency_rows("report age", report_ages(shots, clock)),
        throughput=[Throughput("sensor", work / max(seconds["sensor"], 1e-9), "pixel-cycles/s")],
        files=["scenario.toml", STREAM],
    )


def _late_notes(run: _Prepared, shots: list[ContinuousShot]) -> list[str]:
    """What is known only after the run."""
    silent = [
        f"{shot.silent} pixels had not reported by cycle {shot.cycle} and are black in its image"
        for shot in shots
        if shot.silent
    ]
    return [*silent, *run.source.degraded]


def run_continuous(
    name: str,
    scenario: Scenario,
    out: Path | None,
    *,
    resume: bool = False,
    device: str | None = None,
    progress: Progress,
    began: float,
    report: Callable[[ContinuousRun], list[str]],
) -> tuple[Result, Path]:
    """Runs a scenario with the continuous readout and writes its folder, `result.json` last.

    began: time.perf_counter() at the command's start. report: writes figures and report.html and
    returns their names. An interrupted run leaves no result.json and is run afresh.
    Raises InputError for input that cannot be used, Interrupted.
    """
    refuse_options("continuous", resume, device)
    output_folder(name, out, False)
    scenario = with_defaults(scenario)
    run = _prepare(name, scenario)
    with claimed(name, out, False, goes_on=False) as folder:
        begin_folder(folder, to_toml(scenario))
        notes = _early_notes(run)
        for note in notes:
            progress.note(note)
        light = PixelLight(run.source.points()[:SHOWN])
        reports, seconds = _expose(run, light, progress)
        try:
            begin = time.perf_counter()
            write_intensities(reports, folder / STREAM)
            seconds["recorder"] = time.perf_counter() - begin
            begin = time.perf_counter()
            shots = take_shots(reports, run.source, reports.clock, run.instants, run.white)
            result = _make_result(run, reports, shots, seconds)
            result.files += write_images(folder, shots, METHOD)
            seconds["images"] = time.perf_counter() - begin
            late = _late_notes(run, shots)
            for note in late:
                progress.note(note)
            result.files += report(ContinuousRun(
                result, scenario, folder, run.source, run.camera, run.setting, run.lens, run.white,
                reports, shots, light, seconds, began, [*notes, *late],
            ))  # fmt: skip
            result.files.append("result.json")
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
        except KeyboardInterrupt:
            raise Interrupted(run.cycles, run.cycles, AFRESH) from None
    return result, folder
