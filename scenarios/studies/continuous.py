"""`viform bench continuous`: compares continuous photographing with spikes on small scenes.

It generates the table and the figure of docs/continuous.md. Both sensors have the same pixels and
the same light, with shot noise; white gives 0.6 spikes a cycle.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import (
    Block,
    Clock,
    Intensities,
    Light,
    Piece,
    Viform,
    intensity_image,
    join_intensities,
)
from cosim.compute.opencl import Device
from cosim.light.source import Source
from cosim.report.figures import subplots
from scenarios.scenes.charts.patches import StepSource
from scenarios.scenes.drawing.analytic import AnalyticSource
from scenarios.scenes.people.wave import Wave
from sensor import CHIPS, CameraSetting, SpikeCamera, tfi, tfp
from sensor.continuous import ContinuousCamera
from sensor.continuous.run import continuous_setting
from sensor.reconstruct.fidelity import psnr, to_white
from sensor.sections.unlatched import ContinuousSection

CLOCK = Clock(40_000)
THRESHOLD, WHITE_RATE, WINDOW = 1000.0, 0.6, 41
CYCLES, WARM = 2560, 512
BLOCK = 64
DRAWN = 8
"""Number of cycles between two points of the curves in the figure."""
PANELS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("no shot noise", {"shot_noise": False}),
    ("shot noise", {}),
    ("shot noise, measure 1 ms", {"measure": "1 ms"}),
)


@dataclass(frozen=True)
class ContinuousRow:
    """The figures of one sensor for one scene.

    Attributes:
        scene, sensor: names of the scene and of the sensor.
        reports: rate of spikes or reports per pixel, 1/s.
        bits: data rate per pixel, bit/s.
        psnr: mean PSNR over five instants, white = 1, dB.
    """

    scene: str
    sensor: str
    reports: float
    bits: float
    psnr: float


def _camera(shape: tuple[int, int], seed: int = 1) -> CameraSetting:
    chip = dataclasses.replace(CHIPS["spiketwo"], height=shape[0], width=shape[1])
    return CameraSetting(chip, CLOCK, THRESHOLD, seed)


def _white(camera: CameraSetting) -> float:
    """Illuminance on the pixel at which white fires at WHITE_RATE, lux."""
    return WHITE_RATE / camera.rate(1.0)


def _sources(shape: tuple[int, int], lux: float) -> dict[str, Source]:
    stop = CLOCK.edge(CYCLES)
    return {
        "step": StepSource(shape, lux, 0.3, 0.9, 0.03, stop),
        "wave": AnalyticSource(Wave(shape), lux, CLOCK),
    }


def _run(sensor: Any, source: Source) -> list[Any]:
    """The output of a sensor for each block."""
    outputs = []
    for start in range(0, CYCLES, BLOCK):
        light = source.step(None, Block(start, BLOCK))
        if isinstance(sensor, SpikeCamera):
            outputs.append(sensor.step(light, Block(start, BLOCK)))
        else:
            outputs.append(sensor.step(light, CLOCK.edge(start), CLOCK.edge(start + BLOCK)))
    return outputs


def _instants() -> list[int]:
    return [WARM + (CYCLES - WARM) * (2 * n + 1) // 10 for n in range(5)]


def _fidelity(source: Source, image: Any) -> float:
    """Mean PSNR of `image(cycle)` over the instants, white = 1, dB."""
    return float(np.mean([psnr(image(n), source.truth(CLOCK.middle(n))) for n in _instants()]))


def compare(
    shape: tuple[int, int] = (100, 100),
    scenes: tuple[str, ...] = ("step", "wave"),
    device: Device | None = None,
) -> list[ContinuousRow]:
    """Compares both sensors on each scene: spikes, reconstructed by TFP and TFI, and continuous
    photographing with its defaults and with one key changed at a time.

    Args:
        shape: (height, width) of the array, pixels.
        scenes: names of the scenes.
        device: OpenCL device of the spike camera, None for numba. It does not change the rows.
    """
    camera = _camera(shape)
    white = WHITE_RATE * THRESHOLD * CLOCK.hz  # electrons a second
    sections = {
        "continuous, defaults": ContinuousSection(),
        "continuous, measure 1 ms": ContinuousSection.model_validate({"measure": "1 ms"}),
        "continuous, contrast 0.2": ContinuousSection.model_validate({"contrast": 0.2}),
        "continuous, time_constant 1 ms": ContinuousSection.model_validate(
            {"time_constant": "1 ms"}
        ),
    }
    rows, seconds = [], CYCLES / CLOCK.hz
    pixels = shape[0] * shape[1]
    sources = _sources(shape, _white(camera))
    for name in scenes:
        source = sources[name]
        blocks = _run(SpikeCamera(camera, device), source)
        stream = Viform(np.concatenate([b.words for b in blocks]), CYCLES, CLOCK)
        spikes = int(np.bitwise_count(stream.words).sum(dtype=np.int64)) / pixels / seconds
        for method, image in (
            ("spikes, TFP", lambda n, s=stream: tfp(s, n, WINDOW)),
            ("spikes, TFI", lambda n, s=stream: tfi(s, n)),
        ):
            quality = _fidelity(source, lambda n, i=image: to_white(i(n), WHITE_RATE))
            rows.append(ContinuousRow(name, method, spikes, CLOCK.hz, quality))
        for title, section in sections.items():
            setting = continuous_setting(section, camera)
            reports = join_intensities(_run(ContinuousCamera(setting), source))
            rate = len(reports) / pixels / seconds
            quality = _fidelity(
                source, lambda n, r=reports: np.clip(intensity_image(r, n) / white, 0, 1)
            )
            rows.append(ContinuousRow(name, title, rate, rate * setting.report_bits, quality))
    return rows


def _course(tick: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """The light of the figure at ticks, white = 1: constant, a step up, a sine, a step into the
    dark."""
    t = tick / CLOCK.hz * 1e3
    sine = 0.5 + 0.35 * np.sin(2 * np.pi * (t - 20) / 12)
    light = np.where(t < 8, 0.2, np.where(t < 20, 0.5, np.where(t < 44, sine, 0.06)))
    return np.asarray(light, np.float64)


def traces_figure(path: Path, cycles: int = CYCLES) -> list[Intensities]:
    """Draws the photocurrent of a pixel, the current at its monitor, and its reports, for each of
    `PANELS`; returns the reports."""
    camera = _camera((1, 1))
    white = WHITE_RATE * THRESHOLD * CLOCK.hz
    ticks = np.arange(0, cycles, DRAWN)
    lights = [
        Light((Piece(CLOCK.edge(n), CLOCK.edge(n + DRAWN), plane, plane),))
        for n in ticks.tolist()
        for plane in [np.full((1, 1), _course(np.array(n)) * _white(camera), np.float32)]
    ]
    figure, axes = subplots(len(PANELS), 1, figsize=(9, 7.6), sharex=True, sharey=True)
    ms, all_reports = 1e3 / CLOCK.hz, []
    for axis, (title, keys) in zip(axes, PANELS, strict=True):
        sensor = ContinuousCamera(
            continuous_setting(ContinuousSection.model_validate(keys), camera)
        )
        parts, currents = [], []
        for light in lights:
            parts.append(sensor.step(light, light.pieces[0].start, light.pieces[0].stop))
            currents.append(sensor.state()["current"][0])
        reports = join_intensities(parts)
        all_reports.append(reports)
        axis.plot(
            (ticks + DRAWN) * ms, np.array(currents) / white, color="#9db4d8", linewidth=3,
            label="current at the monitor",
        )  # fmt: skip
        axis.step(
            ticks * ms, _course(ticks), where="post", color="#1d2433", linewidth=1,
            label="photocurrent",
        )  # fmt: skip
        times = np.append(reports.time, cycles) * ms
        values = np.append(reports.value, reports.value[-1]) / white
        axis.step(times, values, where="post", color="#d9480f", linewidth=1.2, label="reported")
        axis.plot(times[:-1], values[:-1], ".", color="#d9480f", markersize=5)
        axis.set_title(f"{title}: {len(reports)} reports", loc="left", fontsize=10)
        axis.set_ylabel("current, white = 1")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False, ncols=3, fontsize=9, loc="upper right")
    axes[0].set_ylim(0, 1.08)
    axes[-1].set_xlabel("ms")
    axes[-1].set_xlim(0, cycles * ms)
    figure.tight_layout()
    figure.savefig(path, dpi=110, format="png")
    return all_reports


def markdown(rows: list[ContinuousRow]) -> str:
    """The rows as a Markdown table."""
    lines = [
        "| scene | sensor | reports/s per pixel | bits/s per pixel | PSNR, dB |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| `{row.scene}` | {row.sensor} | {row.reports:.0f} | {row.bits:.0f} | {row.psnr:.1f} |"
        for row in rows
    ]
    return "\n".join(lines)
