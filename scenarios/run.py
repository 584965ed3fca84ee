"""A run: the chain from the scene to the recorder or the display, then images, figures and the
documents."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from cosim import Interrupted
from cosim.files import ZarrStream
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.run.folder import check_room, claimed, mend, output_folder, write_images
from cosim.run.progress import Progress
from cosim.run.result import Error, Latency, Metric, Result, Throughput, write_result
from scenarios.assemble.boards import NO_ERROR, open_boards
from scenarios.assemble.checked import full_physics_s, left_out, too_far
from scenarios.assemble.filming import CHECKPOINT, PUT_BACK, STREAM, film_as_promised
from scenarios.assemble.glass_result import Shown, finish_glass, judge_seen, write_eye_images
from scenarios.assemble.planning import RunPlan
from scenarios.assemble.prepare import Prepared, prepare
from scenarios.assemble.scenario import Scenario
from scenarios.assemble.verifier import Finding
from sensor import CameraSetting
from sensor.codec.size import Sizes, measure_sizes, size_metrics
from sensor.reconstruct.fidelity import Shot, interval_latency, judge, spike_rate, take_shots

__all__ = ["Finished", "Progress", "run_scenario"]


@dataclass
class Finished:
    """What a run leaves in memory for its report. shots, sizes: of a run without a display; shown:
    of one with it."""

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
    instants: list[int]
    shots: list[Shot]
    sizes: Sizes | None
    shown: Shown | None
    seconds: dict[str, float]
    began: float
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Made:
    """What is made of a stream once it is whole."""

    shots: list[Shot]
    sizes: Sizes | None
    shown: Shown | None
    metrics: dict[str, Metric]
    latency: list[Latency]
    files: list[str]


def _make_images(
    run: Prepared, stream: ZarrStream, folder: Path, seconds: dict[str, float]
) -> _Made:
    """Of a run without a display: images of the stream and its size."""
    begin = time.perf_counter()
    shots = take_shots(stream, run.source, run.instants, run.scenario.image.window, run.white_rate)
    files = write_images(folder, shots)
    metrics = judge(shots) | {"spike_rate": Metric(spike_rate(stream), "spikes/cycle")}
    seconds["images"] = time.perf_counter() - begin
    begin = time.perf_counter()
    sizes = measure_sizes(stream, run.setting.threshold, run.setting.threshold_noise)
    seconds["sizes"] = time.perf_counter() - begin
    return _Made(shots, sizes, None, metrics, interval_latency(stream.clock, shots), files)


def _make_views(run: Prepared, folder: Path, seconds: dict[str, float]) -> _Made:
    """Of a run with a display: what eyes see of it."""
    assert run.glass is not None
    begin = time.perf_counter()
    with ThreadPoolExecutor(1) as pool:  # each of the two leaves much of two cores idle
        probing = pool.submit(run.glass.probes, run.setting, run.device)
        judged = judge_seen(run.glass)
        seconds["images"] = time.perf_counter() - begin
        shown = finish_glass(run.glass, judged, probing.result())
    seconds["probes"] = time.perf_counter() - begin - seconds["images"]
    begin = time.perf_counter()
    files = write_eye_images(folder, shown)
    pixels = run.camera.shape[0] * run.camera.shape[1]
    rate = run.glass.shown.fired / (run.cycles * pixels)
    metrics = shown.metrics() | {"spike_rate": Metric(rate, "spikes/cycle")}
    seconds["images"] += time.perf_counter() - begin
    return _Made([], None, shown, metrics, shown.latency(), files)


def _result(
    run: Prepared, made: _Made, seconds: dict[str, float], throughput: list[Throughput]
) -> Result:
    pixels = run.camera.shape[0] * run.camera.shape[1]
    full = full_physics_s(run.verifier, pixels, run.cycles)
    return Result(
        scenario=run.name,
        outcome="degraded" if run.source.degraded else "ok",
        seed=run.scenario.seed,
        device=run.device.name if run.device is not None else "numba on this processor",
        simulated_s=run.cycles / run.setting.clock.hz,
        tolerance=run.scenario.tolerance,
        renderer=None if run.glass is None else run.glass.shown.renderer.name,
        error=Error(None, NO_ERROR, None) if run.verifier is None else run.verifier.told(),
        kept=[] if run.verifier is None else list(run.plan.plan.everywhere),
        left_out=left_out(run.plan, run.verifier),
        metrics={
            **made.metrics,
            "white_rate": Metric(run.white_rate, "spikes/cycle"),
            "f_number": Metric(run.lens.f_number, "1"),
            "camera": Metric(seconds["sensor"] if throughput else None, "s"),
            "full_physics": Metric(full, "s"),
            **({} if made.sizes is None else size_metrics(made.sizes)),
            **run.boards.metrics(run.camera),
        },
        latency=made.latency,
        throughput=throughput,
        files=["scenario.toml", STREAM, *made.files],
    )


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
    with open_boards(scenario, resume) as boards:
        run = prepare(name, scenario, device, boards)
        pixels = run.camera.shape[0] * run.camera.shape[1]
        try:
            check_room(place, run.cycles * pixels)
            with claimed(name, out, resume) as folder:
                filmed = film_as_promised(run, folder, resume, progress)
                run, seconds, done = filmed.run, filmed.seconds, False
                try:
                    progress.start("images and report", 2)
                    stream = ZarrStream(folder / STREAM)
                    made = (
                        _make_images(run, stream, folder, seconds) if run.glass is None
                        else _make_views(run, folder, seconds)
                    )  # fmt: skip
                    result = _result(run, made, seconds, filmed.throughput)
                    progress.advance(1)
                    short = too_far(run.plan, run.verifier)
                    if short:
                        result.outcome = "degraded"
                    faults = run.boards.faults(run.camera)
                    if faults:
                        result.outcome = "failed"
                    for note in [*run.source.degraded, *short, *faults]:
                        progress.note(note)
                    told = [f.told for f in filmed.put_back]
                    result.files += report(Finished(
                        result, scenario, folder, run.source, run.setting, run.plan,
                        filmed.put_back, run.lens, run.white_rate, stream, run.instants, made.shots,
                        made.sizes, made.shown, seconds, began,
                        [*run.notes, *run.source.notes, *told, *run.source.degraded, *short,
                         *faults],
                    ))  # fmt: skip
                    result.files.append("result.json")
                    progress.advance(2)
                    result.run_time_s = time.perf_counter() - began
                    write_result(folder, result)
                    for name_of in (CHECKPOINT, PUT_BACK):
                        (folder / name_of).unlink(missing_ok=True)
                    done = True
                except KeyboardInterrupt:
                    raise Interrupted(run.cycles, run.cycles, mend(folder)) from None
                finally:
                    if not done:  # whatever it was, what was filmed is kept
                        with suppress(OSError):  # a full disk
                            filmed.save()
        finally:
            if run.glass is not None:
                run.glass.close()
    return result, folder
