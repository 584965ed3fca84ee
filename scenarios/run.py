"""A run: scene, lens, chip and recorder in one chain, then images, figures and the documents."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from cosim import Block, Checkpoint, Clock, InputError, Light, Plane, run_blocks, seconds_to_ps
from cosim.files import Recorder, ZarrStream
from cosim.files.whole import whole
from cosim.lens import FASTEST_F_NUMBER, Lens
from cosim.opencl import Device, open_device
from scenarios.fidelity import psnr, ssim, to_white
from scenarios.loading import to_toml
from scenarios.png import write_linear_png
from scenarios.result import Latency, Metric, Result, Throughput, dumps, viform_version
from scenarios.scenes import Source, make_source
from scenarios.schema import Scenario
from sensor import CHIPS, CameraSetting, SpikeCamera, isi, tfi, tfp

__all__ = ["Finished", "Progress", "Shot", "choose_device", "output_folder", "run_scenario"]


class Progress(Protocol):
    """Where a run says how far it is."""

    def start(self, what: str, total: int) -> None: ...
    def advance(self, done: int) -> None: ...
    def note(self, text: str) -> None: ...


@dataclass(frozen=True, eq=False)
class Shot:
    """One instant: cycle, true reflectance, and the estimates of it, white = 1, (H, W) float32."""

    cycle: int
    truth: Plane
    tfp: Plane
    tfi: Plane


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
    seconds: dict[str, float]
    notes: list[str] = field(default_factory=list)


def output_folder(name: str, out: Path | None, resume: bool) -> Path:
    """The folder of a run: `out`, else the first free runs/<name>-<n>."""
    if out is None:
        if resume:
            raise InputError("--resume", "given with --out", "alone", "say --out and the run's folder")
        n = 1
        while (Path("runs") / f"{name}-{n}").exists():
            n += 1
        return Path("runs") / f"{name}-{n}"
    if out.exists() and not out.is_dir():
        raise InputError("--out", "a folder", f"the file {out}", "choose another name")
    if out.is_dir() and any(out.iterdir()) and not resume:
        raise InputError("--out", "a new or empty folder", str(out), "choose another, or add --resume")
    return out


def _lens(scenario: Scenario, setting: CameraSetting) -> Lens:
    """The scenario's lens; without an f-number the one that lets white fire at white_rate."""
    section = scenario.sensor.lens
    number = section.f_number
    shape = {
        "transmission": section.transmission,
        "magnification": section.magnification,
        "psf": section.psf,
        "wavelength_nm": scenario.sensor.wavelength,
    }
    if number is None:
        wide_open = Lens(FASTEST_F_NUMBER, **shape)
        rate = setting.rate(scenario.scene.illuminance * wide_open.gain)
        number = FASTEST_F_NUMBER * math.sqrt(rate / section.white_rate)
        if number < FASTEST_F_NUMBER:
            need = scenario.scene.illuminance * section.white_rate / rate if rate else math.inf
            light = f"at least {need:.3g} lux" if rate else "more than 0 lux"
            raise InputError(
                "scene.illuminance",
                f"{light} for white to fire at {section.white_rate:g} a cycle through any lens",
                f"{scenario.scene.illuminance:g} lux",
                "raise it, lower sensor.threshold, or give sensor.lens.f_number",
            )
    return Lens(min(number, 1e6), **shape)


def _setting(scenario: Scenario) -> CameraSetting:
    section = scenario.sensor
    return CameraSetting(
        CHIPS[section.chip],
        Clock.from_hz(section.clock),
        section.threshold,
        scenario.seed,
        section.wavelength,
    )


def _identity(scenario: Scenario) -> str:
    """Text that names a run's inputs: the scenario without what does not change its bits, the
    program's version, and the clip's content."""
    text = to_toml(scenario) + viform_version()
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
            "image.at", f"cycles from 0 to {cycles - 1}", str(late[0]), "lengthen duration or drop it"
        )
    return list(at)


class _RelayStage:
    """The lens as a stage."""

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        self._relay = lens.relay(pitch_um)

    def step(self, given: Light, block: Block) -> Light:
        return self._relay(given)


def choose_device(wanted: str | None) -> Device | None:
    """The OpenCL device asked for; None for "numba", the compiled form on this processor."""
    return None if wanted is not None and wanted.lower() == "numba" else open_device(wanted)


def _shots(
    stream: ZarrStream, source: Source, instants: list[int], window: int, white_rate: float
) -> list[Shot]:
    clock = stream.clock
    return [
        Shot(
            cycle,
            source.truth(clock.middle(cycle)),
            to_white(tfp(stream, cycle, window), white_rate),
            to_white(tfi(stream, cycle), white_rate),
        )
        for cycle in instants
    ]


def _metrics(shots: list[Shot]) -> dict[str, Metric]:
    """PSNR and SSIM of both methods, mean over the instants."""
    means = {}
    for method in ("tfp", "tfi"):
        pairs = [(getattr(shot, method), shot.truth) for shot in shots]
        means[f"{method}_psnr"] = Metric(float(np.mean([psnr(*pair) for pair in pairs])), "dB")
        means[f"{method}_ssim"] = Metric(float(np.mean([ssim(*pair) for pair in pairs])), "1")
    return means


def _interval_latency(stream: ZarrStream, instants: list[int]) -> list[Latency]:
    """How long the interval that tells a pixel's light is: over pixels and instants."""
    tau = np.concatenate([isi(stream, cycle).ravel() for cycle in instants])
    tau = tau[tau > 0]
    if tau.size == 0:
        return []
    us = 1e6 / stream.clock.hz
    return [Latency("interval", float(tau.min() * us), float(np.median(tau) * us), float(tau.max() * us))]


def _spike_rate(stream: ZarrStream) -> float:
    """Spikes a pixel and cycle, over the whole stream."""
    chunk, words = 2, -(-stream.cycles // 32)
    total = sum(
        int(np.bitwise_count(stream.read_words(w, w + chunk)).sum(dtype=np.int64))
        for w in range(0, words, chunk)
    )
    return total / (stream.cycles * stream.shape[0] * stream.shape[1])


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
    folder = output_folder(name, out, resume)
    setting = _setting(scenario)
    chip, clock = setting.chip, setting.clock
    cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
    instants = _instants(scenario, cycles)
    lens = _lens(scenario, setting)
    white_rate = setting.rate(scenario.scene.illuminance * lens.gain)
    source = make_source(scenario.scene, (chip.height, chip.width), clock, cycles)
    opened = choose_device(device)
    camera = SpikeCamera(setting, opened)

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").unlink(missing_ok=True)
    with whole(folder / "scenario.toml") as part:
        part.write_text(to_toml(scenario))
    store = folder / "stream.zarr"
    recorder = Recorder(store, camera.shape, cycles, clock)
    stages: dict[str, Any] = {
        "scene": source,
        "lens": _RelayStage(lens, chip.pitch),
        "sensor": camera,
        "recorder": recorder,
    }
    checkpoint = Checkpoint(folder / "checkpoint.npz", _identity(scenario))
    notes = [
        *([] if scenario.sensor.lens.f_number else [f"f/{lens.f_number:.3g} chosen so that white fires at {white_rate:.3g} a cycle"]),
        *source.notes,
    ]
    for note in notes:
        progress.note(note)
    progress.start(f"{name}: {cycles} cycles of {chip.width} x {chip.height}", cycles)
    seconds = run_blocks(
        stages, cycles, checkpoint=checkpoint, resume=resume, progress=progress.advance,
        mend=f"go on with the same command and --out {folder} --resume",
    )  # fmt: skip

    progress.start("images and report", 3)
    begin = time.perf_counter()
    stream = ZarrStream(store)
    shots = _shots(stream, source, instants, scenario.image.window, white_rate)
    (folder / "images").mkdir(exist_ok=True)
    files = ["scenario.toml", "stream.zarr"]
    for shot in shots:
        for method in ("truth", "tfp", "tfi"):
            files.append(f"images/{method}-{shot.cycle:05d}.png")
            write_linear_png(folder / files[-1], getattr(shot, method))
    progress.advance(1)
    spike_rate = _spike_rate(stream)
    result = Result(
        scenario=name,
        outcome="degraded" if source.degraded else "ok",
        seed=scenario.seed,
        device=opened.name if opened is not None else "numba on this processor",
        simulated_s=cycles / clock.hz,
        tolerance=scenario.tolerance,
        kept=[effect.name for effect in setting.effects],
        metrics={
            **_metrics(shots),
            "spike_rate": Metric(spike_rate, "spikes/cycle"),
            "white_rate": Metric(white_rate, "spikes/cycle"),
            "f_number": Metric(lens.f_number, "1"),
        },
        latency=_interval_latency(stream, instants),
    )
    progress.advance(2)
    seconds["images"] = time.perf_counter() - begin
    pixel_cycles = cycles * chip.width * chip.height
    if not resume:
        result.throughput = [
            Throughput("sensor", pixel_cycles / seconds["sensor"], "pixel-cycles/s"),
            Throughput("recorder", recorder.bytes_written * 8 / seconds["recorder"], "bit/s"),
        ]
    for note in source.degraded:
        progress.note(note)
    result.files = [*files, *report(Finished(
        result, scenario, folder, source, setting, lens, white_rate, stream, shots, seconds,
        [*notes, *source.degraded],
    )), "result.json"]  # fmt: skip
    progress.advance(3)
    checkpoint.path.unlink(missing_ok=True)
    result.run_time_s = time.perf_counter() - began
    with whole(folder / "result.json") as part:
        part.write_text(dumps(result.document()) + "\n")
    return result, folder

