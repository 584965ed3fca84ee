"""Dim pixels of a latched camera: readings below threshold, and rejection of the dark."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from cosim.run.result import Metric
from scenarios.assemble.camera.dim_limits import cycles_between, dark_cycles
from scenarios.assemble.camera.setup import CameraSetup
from sensor import SpikeCamera
from sensor.dynamic_range import spike_dynamic_range
from sensor.latched.reading import ReadingCamera
from sensor.reconstruct.readings import READINGS, DimLight, write_readings
from sensor.reconstruct.shots import Shot


def reading_camera(camera: SpikeCamera, setup: CameraSetup) -> SpikeCamera | ReadingCamera:
    """The camera of a run, which also reads the charge if the scenario has it do so."""
    section = setup.scenario.sensor.sub_threshold
    if section is None:
        return camera
    every = cycles_between(setup.scenario.sensor, setup.setting)
    return ReadingCamera(camera, setup.setting, every, section.levels)


def dim_light(setup: CameraSetup, camera: Any, folder: Path) -> tuple[DimLight | None, list[str]]:
    """How the images of a run have dim pixels, None for from spikes alone; and the names of the
    files that this writes into the folder."""
    readings = camera.readings() if isinstance(camera, ReadingCamera) else None
    dark = dark_cycles(setup.scenario.sensor, setup.setting)
    if readings is None:
        return (DimLight(dark=dark) if math.isfinite(dark) else None), []
    write_readings(readings, folder / READINGS)
    return DimLight(readings, dark), [READINGS]


def dim_range(setup: CameraSetup) -> float | None:
    """Dynamic range with readings, dB: 20 lg(limit / cycle N); None without them."""
    sensor = setup.scenario.sensor
    if sensor.sub_threshold is None:
        return None
    return spike_dynamic_range(
        cycles_between(sensor, setup.setting), 1, sensor.sub_threshold.levels
    )


def dim_metrics(setup: CameraSetup, shots: list[Shot]) -> dict[str, Metric]:
    """Pixels that are read and rejected, mean over the images."""
    masks = [shot.dim for shot in shots if shot.dim is not None]
    metrics: dict[str, Metric] = {}
    if masks and setup.scenario.sensor.sub_threshold is not None:
        read = float(np.mean([dim.read.sum() for dim in masks]))
        metrics["sub_threshold_pixels"] = Metric(read, "pixels")
        metrics["dynamic_range_formula"] = Metric(dim_range(setup), "dB")
    if masks and setup.scenario.sensor.dark_limit is not None:
        dark = float(np.mean([dim.dark.sum() for dim in masks]))
        metrics["dark_pixels"] = Metric(dark, "pixels")
        limit = dark_cycles(setup.scenario.sensor, setup.setting) / setup.setting.clock.hz
        metrics["dark_limit"] = Metric(limit, "s")
    return metrics
