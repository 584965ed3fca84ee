"""A run: scene, lens, chip and recorder in one chain, then images, figures and the documents."""

from __future__ import annotations

import errno
import hashlib
import json
import shlex
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from shutil import rmtree
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
from cosim.files.whole import whole
from cosim.lens import Lens
from cosim.opencl import Device, open_device
from scenarios.checked import full_physics_s, left_out, shortfall, too_far
from scenarios.display_setting import display_of
from scenarios.exposure import camera_setting, choose_lens, lens_notes
from scenarios.fidelity import Shot, interval_latency, judge, spike_rate, take_shots
from scenarios.folder import begin_folder, check_room, claimed, output_folder, write_images
from scenarios.loading import to_toml
from scenarios.planning import Look, RunPlan, look, plan_run
from scenarios.progress import Progress
from scenarios.result import Metric, Result, Throughput, dumps, viform_version, write_result
from scenarios.scenes import Source, make_source
from scenarios.schema import Scenario
from scenarios.stream_size import Sizes, measure_sizes, size_metrics
from scenarios.verifier import ARITHMETIC, BrokenPromise, Finding, Verifier
from sensor import CameraSetting, SpikeCamera

__all__ = ["Finished", "Progress", "WiderStage", "choose_device", "run_scenario"]


CHECKPOINT = "checkpoint.npz"
"""In a run's folder while it is not finished."""
PUT_BACK = "put_back.json"
"""Beside it where a promise was broken."""


@dataclass
class Finished:
    """What a run leaves in memory for its report."""

    result: Result
    scenario: Scenario
    folder: Path
    source: Source
    setting: CameraSetting
    plan: RunPlan
    put_back: list[Finding]
    lens: Lens
    white_rate: float
    stream: ZarrStream
    shots: list[Shot]
    sizes: Sizes
    seconds: dict[str, float]
    began: float
    notes: list[str] = field(default_factory=list)


def _identity(scenario: Scenario, plan: RunPlan) -> str:
    """Text that names a run's inputs: the scenario, what is left out of it, the program's version,
    and the clip's content."""
    text = to_toml(scenario.model_copy(update={"title": ""})) + viform_version() + plan.tier
    for name, tiles in plan.plan.kept.items():
        text += name + hashlib.sha256(tiles.tobytes()).hexdigest()
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


class WiderStage:
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
    plan: RunPlan
    camera: SpikeCamera
    verifier: Verifier
    notes: list[str]


def prepare_camera(
    scenario: Scenario, device: str | None
) -> tuple[CameraSetting, int, list[int], Lens, float, Device | None]:
    """Setting, cycles, instants, lens, rate of white and device of a checked scenario."""
    setting = camera_setting(scenario)
    cycles = setting.clock.cycles_in(seconds_to_ps(scenario.duration))
    instants = _instants(scenario, cycles)
    lens = choose_lens(scenario, setting)
    # A chosen f-number's rounding must not show in the white that was asked for.
    white_rate = (
        setting.rate(scenario.scene.illuminance * lens.gain)
        if scenario.sensor.lens.f_number is not None
        else scenario.sensor.lens.white_rate
    )
    return setting, cycles, instants, lens, white_rate, choose_device(device)


def scene_source(scenario: Scenario, setting: CameraSetting, cycles: int) -> Source:
    """The scene on the chip's pixels."""
    chip = setting.chip
    return make_source(
        scenario.scene, (chip.height, chip.width), setting.clock, cycles, setting.reach == (0, 0)
    )


def look_at(scenario: Scenario, setting: CameraSetting, lens: Lens, cycles: int) -> Look:
    """What the plan reads of the scene."""
    source = scene_source(scenario, setting, cycles)
    return look(scenario, setting, source, lens.relay(setting.chip.pitch), cycles)


def _prepare(name: str, scenario: Scenario, device: str | None) -> _Prepared:
    setting, cycles, instants, lens, white_rate, opened = prepare_camera(scenario, device)
    source = scene_source(scenario, setting, cycles)
    seen = look_at(scenario, setting, lens, cycles)
    plan = plan_run(
        seen, setting, scenario.tolerance, instants, opened,
        display=display_of(scenario, setting, white_rate, instants, cycles),
    )  # fmt: skip
    return _Prepared(
        name, scenario, setting, cycles, instants, lens, white_rate, source, opened, plan,
        *_planned(plan, setting, scenario, opened), lens_notes(scenario, lens, white_rate),
    )  # fmt: skip


def _planned(
    plan: RunPlan, setting: CameraSetting, scenario: Scenario, device: Device | None
) -> tuple[SpikeCamera, Verifier]:
    """The camera as planned and the stage that checks it."""
    camera = SpikeCamera(plan.setting, device, tier=plan.tier, flags=plan.flags)
    return camera, plan.verifier(setting, scenario.seed, device)


def _again(run: _Prepared, forced: list[str]) -> _Prepared:
    """The run with these effects kept."""
    scenario, setting = run.scenario, run.setting
    plan = plan_run(
        run.plan.look, setting, scenario.tolerance, run.instants, run.device,
        forced=[name for name in forced if name != ARITHMETIC],
        tier="exact" if ARITHMETIC in forced else None, display=run.plan.full_display,
    )  # fmt: skip
    camera, verifier = _planned(plan, setting, scenario, run.device)
    source = scene_source(scenario, setting, run.cycles)
    return replace(run, plan=plan, camera=camera, verifier=verifier, source=source)


def _film(
    run: _Prepared, folder: Path, resume: bool, progress: Progress
) -> tuple[dict[str, float], list[Throughput]]:
    """Runs the chain; seconds of every stage, and throughput unless only a part was run now."""
    chip, clock, cycles = run.setting.chip, run.setting.clock, run.cycles
    store = folder / "stream.zarr"
    recorder = Recorder(store, run.camera.shape, cycles, clock)
    stages: dict[str, Any] = {
        "scene": WiderStage(run.source, run.setting.reach),
        "lens": _RelayStage(run.lens, chip.pitch),
        "check": run.verifier,
        "sensor": run.camera,
        "recorder": recorder,
    }
    checkpoint = Checkpoint(folder / CHECKPOINT, _identity(run.scenario, run.plan))
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


def _put_back_before(path: Path) -> list[Finding]:
    """What the run that is gone on with has put back so far."""
    if not path.exists():
        return []
    try:
        return [Finding(**found) for found in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError) as exc:
        raise InputError(
            PUT_BACK, "the one that this run wrote", "a damaged file",
            f"remove {path.parent} and run it afresh",
        ) from exc  # fmt: skip


def _film_as_promised(
    run: _Prepared, folder: Path, resume: bool, progress: Progress
) -> tuple[_Prepared, dict[str, float], list[Throughput], list[Finding]]:
    """Films, and films again with an effect put back as long as a promise is broken."""
    kept = folder / PUT_BACK
    found = _put_back_before(kept) if resume and (folder / CHECKPOINT).exists() else []
    if found:
        run = _again(run, [f.effect for f in found])
    while True:
        try:
            seconds, throughput = _film(run, folder, resume, progress)
            new = shortfall(run.plan, run.verifier)
        except BrokenPromise as exc:
            new = exc.findings
        if not new:
            return run, seconds, throughput, found
        found += new
        for finding in new:
            progress.note(finding.told)
        (folder / CHECKPOINT).unlink(missing_ok=True)
        rmtree(folder / "stream.zarr", ignore_errors=True)
        with whole(kept) as part:
            part.write_text(dumps([asdict(f) for f in found]), encoding="utf-8")
        run, resume = _again(run, [f.effect for f in found]), False


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
    pixels = run.camera.shape[0] * run.camera.shape[1]
    check_room(place, run.cycles * pixels)
    with claimed(name, out, resume) as folder:
        run, seconds, throughput, put_back = _film_as_promised(run, folder, resume, progress)
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
                error=run.verifier.told(),
                kept=list(run.plan.plan.everywhere),
                left_out=left_out(run.plan, run.verifier),
                metrics={
                    **judge(shots),
                    "spike_rate": Metric(spike_rate(stream), "spikes/cycle"),
                    "white_rate": Metric(run.white_rate, "spikes/cycle"),
                    "f_number": Metric(run.lens.f_number, "1"),
                    "camera": Metric(seconds["sensor"] if throughput else None, "s"),
                    "full_physics": Metric(full_physics_s(run.verifier, pixels, run.cycles), "s"),
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
            short = too_far(run.plan, run.verifier)
            if short:
                result.outcome = "degraded"
            for note in [*run.source.degraded, *short]:
                progress.note(note)
            told = [f.told for f in put_back]
            result.files += report(Finished(
                result, scenario, folder, run.source, run.setting, run.plan, put_back,
                run.lens, run.white_rate, stream, shots, sizes, seconds, began,
                [*run.notes, *run.source.notes, *told, *run.source.degraded, *short],
            ))  # fmt: skip
            result.files.append("result.json")
            progress.advance(3)
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
            for name_of in (CHECKPOINT, PUT_BACK):
                (folder / name_of).unlink(missing_ok=True)
        except KeyboardInterrupt:
            raise Interrupted(run.cycles, run.cycles, _mend(folder)) from None
    return result, folder
