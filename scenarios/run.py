"""A run: scene, lens, chip and recorder in one chain, then images, figures and the documents."""

from __future__ import annotations

import errno
import hashlib
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim import (
    Block,
    Checkpoint,
    InputError,
    Interrupted,
    Light,
    run_blocks,
    seconds_to_ps,
)
from cosim.files import Recorder, ZarrStream
from cosim.lens import Lens
from cosim.opencl import Device, open_device
from scenarios.exposure import camera_setting, choose_lens, lens_notes
from scenarios.fidelity import Shot, interval_latency, judge, spike_rate, take_shots
from scenarios.folder import begin_folder, check_room, claimed, output_folder, write_images
from scenarios.loading import to_toml
from scenarios.progress import Progress
from scenarios.result import Metric, Result, Throughput, viform_version, write_result
from scenarios.scenes import Source, make_source
from scenarios.schema import ImageSection, Scenario
from scenarios.stream_size import Sizes, measure_sizes, size_metrics
from sensor import CameraSetting, SpikeCamera

__all__ = ["Finished", "Progress", "choose_device", "run_scenario"]


CHECKPOINT = "checkpoint.npz"
"""In a run's folder while it is not finished."""


@dataclass
class Finished:
    """What a run leaves in memory for its report."""

    result: Result
    scenario: Scenario
    folder: Path
    source: Source
    setting: CameraSetting
    lens: Lens
    white_rate: float
    stream: ZarrStream
    shots: list[Shot]
    sizes: Sizes
    seconds: dict[str, float]
    began: float
    notes: list[str] = field(default_factory=list)


def _identity(scenario: Scenario) -> str:
    """Text that names a run's inputs: the scenario without what does not change its bits, the
    program's version, and the clip's content."""
    same = {"title": "", "tolerance": 0.0, "image": ImageSection()}
    text = to_toml(scenario.model_copy(update=same)) + viform_version()
    path = getattr(scenario.scene, "path", None)
    if path is not None and Path(path).is_file():
        with open(path, "rb") as file:
            text += hashlib.file_digest(file, "sha256").hexdigest()
    return hashlib.sha256(text.encode()).hexdigest()


def _instants(scenario: Scenario, cycles: int) -> list[int]:
    """Cycles whose images are made and judged; five evenly spaced ones unless given."""
    window = scenario.image.window
    if window % 2 == 0:
        raise InputError("image.window", "odd", str(window), f"set {window + 1}")
    if cycles < window:
        raise InputError(
            "duration", f"at least image.window = {window} cycles", f"{cycles} cycles",
            "lengthen it or shorten image.window",
        )  # fmt: skip
    at = scenario.image.at or tuple(cycles * (2 * i + 1) // 10 for i in range(5))
    late = [n for n in at if n >= cycles]
    if late:
        raise InputError(
            "image.at", f"cycles below {cycles}", f"{late[0]}", "lengthen duration or drop it"
        )
    return list(at)


class _WiderStage:
    """The scene, asked for a little more than the block: a camera whose rows are sampled before or
    after the clock's edge needs the light around it."""

    def __init__(self, source: Source, reach: tuple[int, int]) -> None:
        self._source, self._reach = source, reach

    def step(self, given: None, block: Block) -> Light:
        before, after = self._reach
        start = max(block.start - before, 0)
        return self._source.step(given, Block(start, block.stop + after - start))


class _RelayStage:
    """The lens as a stage."""

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        self._relay = lens.relay(pitch_um)

    def step(self, given: Light, block: Block) -> Light:
        return self._relay(given)


def choose_device(wanted: str | None) -> Device | None:
    """The OpenCL device asked for; None for "numba", the compiled form on this processor."""
    return None if wanted is not None and wanted.lower() == "numba" else open_device(wanted)


@dataclass(frozen=True)
class _Prepared:
    """A checked run: everything that can be refused has been."""

    name: str
    scenario: Scenario
    setting: CameraSetting
    cycles: int
    instants: list[int]
    lens: Lens
    white_rate: float
    source: Source
    device: Device | None
    camera: SpikeCamera
    notes: list[str]


def _prepare(name: str, scenario: Scenario, device: str | None) -> _Prepared:
    setting = camera_setting(scenario)
    chip, clock = setting.chip, setting.clock
    cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
    instants = _instants(scenario, cycles)
    lens = choose_lens(scenario, setting)
    # A chosen f-number's rounding must not show in the white that was asked for.
    white_rate = (
        setting.rate(scenario.scene.illuminance * lens.gain)
        if scenario.sensor.lens.f_number is not None
        else scenario.sensor.lens.white_rate
    )
    source = make_source(
        scenario.scene, (chip.height, chip.width), clock, cycles, setting.reach == (0, 0)
    )
    opened = choose_device(device)
    notes = lens_notes(scenario, lens, white_rate)
    return _Prepared(
        name, scenario, setting, cycles, instants, lens, white_rate, source, opened,
        SpikeCamera(setting, opened), notes,
    )  # fmt: skip


def _film(
    run: _Prepared, folder: Path, resume: bool, progress: Progress
) -> tuple[dict[str, float], list[Throughput]]:
    """Runs the chain; seconds of every stage, and throughput unless only a part was run now."""
    chip, clock, cycles = run.setting.chip, run.setting.clock, run.cycles
    store = folder / "stream.zarr"
    recorder = Recorder(store, run.camera.shape, cycles, clock)
    stages: dict[str, Any] = {
        "scene": _WiderStage(run.source, run.setting.reach),
        "lens": _RelayStage(run.lens, chip.pitch),
        "sensor": run.camera,
        "recorder": recorder,
    }
    checkpoint = Checkpoint(folder / CHECKPOINT, _identity(run.scenario))
    if resume and checkpoint.load(stages) and not store.is_dir():  # refuses before it overwrites
        raise InputError("--resume", "given with the run's stream.zarr", "without", "leave it out")
    begin_folder(folder, to_toml(run.scenario))
    for note in [*run.notes, *run.source.notes]:
        progress.note(note)
    progress.start(f"{run.name}: {cycles} cycles of {chip.width} x {chip.height}", cycles)
    try:
        seconds = run_blocks(
            stages, cycles, checkpoint=checkpoint, resume=resume, progress=progress.advance,
            mend=_mend(folder),
        )  # fmt: skip
        checkpoint.save(cycles, stages)
    except OSError as exc:
        if exc.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise
        raise InputError(
            "--out", "where there is room for the stream", f"{folder} ({exc.strerror})",
            f"make room, then {_mend(folder)}",
        ) from exc  # fmt: skip
    if resume:
        return seconds, []
    rate = cycles * chip.width * chip.height / seconds["sensor"]
    bits = recorder.bytes_written * 8 / seconds["recorder"]
    return seconds, [
        Throughput("sensor", rate, "pixel-cycles/s"),
        Throughput("recorder", bits, "bit/s"),
    ]


def _mend(folder: Path) -> str:
    return f"go on with the same command and --out {shlex.quote(str(folder))} --resume"


def run_scenario(
    name: str,
    scenario: Scenario,
    out: Path | None,
    *,
    resume: bool = False,
    device: str | None = None,
    progress: Progress,
    began: float,
    report: Callable[[Finished], list[str]],
) -> tuple[Result, Path]:
    """Runs a scenario and writes its folder; `result.json` comes last, so that a folder with one is
    whole. began: time.perf_counter() at the command's start. report: writes figures and
    report.html and returns their names.

    Raises InputError for input that cannot be used (nothing has been written then), Interrupted.
    """
    place = output_folder(name, out, resume)
    run = _prepare(name, scenario, device)
    check_room(place, run.cycles * run.camera.shape[0] * run.camera.shape[1])
    with claimed(name, out, resume) as folder:
        seconds, throughput = _film(run, folder, resume, progress)
        try:
            progress.start("images and report", 3)
            begin = time.perf_counter()
            stream = ZarrStream(folder / "stream.zarr")
            window = scenario.image.window
            shots = take_shots(stream, run.source, run.instants, window, run.white_rate)
            sizes_begin = time.perf_counter()
            sizes = measure_sizes(stream, run.setting.threshold, run.setting.threshold_noise)
            seconds["sizes"] = time.perf_counter() - sizes_begin
            result = Result(
                scenario=name,
                outcome="degraded" if run.source.degraded else "ok",
                seed=scenario.seed,
                device=run.device.name if run.device is not None else "numba on this processor",
                simulated_s=run.cycles / stream.clock.hz,
                tolerance=scenario.tolerance,
                kept=[effect.name for effect in run.setting.kept],
                metrics={
                    **judge(shots),
                    "spike_rate": Metric(spike_rate(stream), "spikes/cycle"),
                    "white_rate": Metric(run.white_rate, "spikes/cycle"),
                    "f_number": Metric(run.lens.f_number, "1"),
                    **size_metrics(sizes),
                },
                latency=interval_latency(stream.clock, shots),
                throughput=throughput,
                files=["scenario.toml", "stream.zarr"],
            )
            progress.advance(1)
            result.files += write_images(folder, shots)
            progress.advance(2)
            seconds["images"] = time.perf_counter() - begin - seconds["sizes"]
            for note in run.source.degraded:
                progress.note(note)
            result.files += report(Finished(
                result, scenario, folder, run.source, run.setting, run.lens, run.white_rate, stream,
                shots, sizes, seconds, began, [*run.notes, *run.source.notes, *run.source.degraded],
            ))  # fmt: skip
            result.files.append("result.json")
            progress.advance(3)
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
            (folder / CHECKPOINT).unlink(missing_ok=True)
        except KeyboardInterrupt:
            raise Interrupted(run.cycles, run.cycles, _mend(folder)) from None
    return result, folder
