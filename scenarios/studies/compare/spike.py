"""The spike camera in a comparison: simulated with every effect, with two reconstructions."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from cosim import PS, Viform
from cosim.config.toml import to_toml
from cosim.files import Recorder, ZarrStream
from cosim.light.lens import Lens
from cosim.run.chain import STREAM, BlockChain
from cosim.run.folder import begin_folder
from cosim.run.loop import discard_checkpoints
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.boards import refuse_boards
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.studies.compare.measure import Camera, Figure, Image, noise, snr_curve
from scenarios.studies.compare.motion import Motion, edge_blur
from sensor import CameraSetting, SpikeCamera, interval_rate, isi, tfp
from sensor.dynamic_range import decibels, longest_width, spike_dynamic_range
from sensor.reconstruct.fidelity import psnr, to_white

STILLS: Final = 16
"""Number of instants at which the noise of pixels without motion is measured."""
REACH: Final = 2 * PS // 1000
"""Extent before and after the instant in which the motion of the scene is measured, ps."""
PLANES: Final = 33
"""Number of planes of the run in which pixels without motion are detected."""
QUIET: Final = 0.01
"""Largest change of reflectance of a pixel without motion."""


def film_spikes(
    scenario: Scenario, folder: Path, instant: int, device: str | None, progress: Progress
) -> tuple[list[Camera], Lens, Callable[[int], Image]]:
    """Simulates the spike camera and reconstructs the images at an instant.

    Args:
        scenario: scenario of the spike camera.
        folder: folder for the stream.
        instant: instant of the images, ps.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: receives progress and notes.

    Returns:
        The rows for TFI and TFP, the lens, and the function from a time, ps, to the true
        reflectance, (H, W).
    """
    begin = time.perf_counter()
    refuse_boards(scenario)
    setup = set_up_camera(scenario, device)
    setting, cycles, lens, white_rate = setup.setting, setup.cycles, setup.lens, setup.white_rate
    source, camera = setup.source(), SpikeCamera(setting, setup.device)
    folder.mkdir(exist_ok=True)
    recorder = Recorder(folder / STREAM, camera.shape, cycles, setting.clock)
    stages = {**setup.stages(source), "sensor": camera, "recorder": recorder}
    toml = to_toml(scenario)
    begin_folder(folder, toml)
    for note in source.notes:
        progress.note(note)
    chain = BlockChain("spike camera", stages, cycles, toml, folder)
    chain.run(progress)
    discard_checkpoints(chain.checkpoint)
    recorded = ZarrStream(folder / STREAM)
    words = recorded.read_words(0, -(-recorded.cycles // WORD))
    stream = Viform(words, recorded.cycles, recorded.clock)

    def truth(ps: int) -> Image:
        return np.asarray(source.truth(ps), np.float64)

    cycle = setting.clock.cycle_at(instant)
    window = min(scenario.image.window, 2 * min(cycle, cycles - 1 - cycle) + 1)
    cameras = _cameras(
        stream, setting, truth, cycle, window, white_rate, time.perf_counter() - begin
    )
    return cameras, lens, truth


def _cameras(
    stream: Viform, setting: CameraSetting, truth: Callable[[int], Image], cycle: int,
    window: int, white_rate: float, spent: float,
) -> list[Camera]:  # fmt: skip
    clock = setting.clock
    instant, period = clock.middle(cycle), 1 / clock.hz
    span = clock.edge(stream.cycles)
    tau = isi(stream, cycle)
    longest = stream.cycles * period
    near = Motion(truth, instant, max(REACH, window * clock.edge(1)), clock.edge(1), span)
    now = truth(instant)
    still = near.moving() is None
    planes = np.stack([truth(int(t)) for t in np.linspace(0, span, PLANES)])
    quiet = np.asarray(np.ptp(planes, axis=0) < QUIET)
    instants = np.full(now.shape[0], instant)
    steps = np.linspace(window, stream.cycles - 1 - window, STILLS).astype(int)
    median = float(np.median(tau[tau > 0])) if (tau > 0).any() else float("nan")
    current = 0.0 if setting.pattern is None else setting.pattern.dark
    dark = longest_width(setting.threshold, current) if current > 0 else longest
    rate = stream.shape[0] * stream.shape[1] * clock.hz
    methods = {
        "tfi": (
            lambda at: to_white(interval_rate(isi(stream, at)), white_rate),
            spike_dynamic_range(longest, period), spike_dynamic_range(dark, period), median,
            "inverse of the interval at the instant",
        ),
        "tfp": (
            lambda at: to_white(tfp(stream, at, window), white_rate),
            decibels(window), spike_dynamic_range(dark, period), float(window),
            f"spikes counted in {window} cycles",
        ),
    }  # fmt: skip
    cameras = []
    for name, (estimate, within, ever, width, text) in methods.items():
        image = estimate(cycle)
        stills = [estimate(int(at)) for at in steps]
        blur, unknown = edge_blur(near, image, now, instants)
        notes = (
            [
                "the whole chip",
                "no motion: blur of the static scene" if still else "",
                "range of one image: intervals within this run",
            ]
            if name == "tfi"
            else ["the same stream"]
        )
        figures = {
            "dynamic_range": Figure(within, "dB"),
            "dynamic_range_controls": Figure(ever, "dB"),
            "blur": Figure(blur, "pixels"),
            "noise": Figure(noise(stills, now, quiet), "1"),
            "data_rate": Figure(rate, "bit/s"),
            "data_rate_pixel": Figure(clock.hz, "bit/s/pixel"),
            # Half of the integration time, then the plane is read in the next cycle.
            "latency": Figure((width / 2 + 1) * period * 1e3 if width == width else None, "ms"),
            "psnr": Figure(psnr(image, now.astype(np.float32)), "dB"),
            "psnr_smear_corrected": Figure(None, "dB"),
            "skew": Figure(setting.row_skew * period * 1e3, "ms"),
            "exposure": Figure(width * period * 1e3 if width == width else None, "ms"),
            "saturated": Figure(float((image >= 1).mean()), "1"),
            "off": Figure(0.0, "ms"),
        }
        cameras.append(Camera(
            f"spike-{name}", f"spike camera, {name.upper()}",
            f"{clock.hz / 1e3:g} kHz, threshold {setting.threshold:g} e, {text}",
            "; ".join(note for note in (*notes, unknown) if note),
            image, figures, spent if name == "tfi" else 0.0,
            snr=snr_curve(stills, now, quiet),
        ))  # fmt: skip
    return cameras
