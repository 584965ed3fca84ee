"""Dim pixels of a latched camera: readings below threshold, and rejection of the dark."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import InputError
from cosim.run.result import Metric
from scenarios.assemble.camera.setup import CameraSetup
from sensor import CameraSetting, SpikeCamera
from sensor.dynamic_range import longest_width, spike_dynamic_range
from sensor.latched.reading import ReadingCamera
from sensor.reconstruct.readings import READINGS, DimLight, write_readings
from sensor.reconstruct.shots import Shot
from sensor.sections.sensor import SensorSection

__all__ = ["dark_cycles", "dim_light", "dim_metrics", "dim_range", "reading_camera"]

_MOST: Final = 2**31
"""Readings of single pixels that a run may take; they are kept in memory, two bytes each."""


def _every(setup: CameraSetup) -> int:
    """Cycles between two readings. Raises InputError for a limit that the run does not hold, or
    for too many readings."""
    section = setup.scenario.sensor.sub_threshold
    assert section is not None
    every = round(section.limit * setup.setting.clock.hz)
    if not 1 <= every <= setup.cycles:
        raise InputError(
            "sensor.sub_threshold.limit", f"1 to {setup.cycles} cycles, the run's", f"{every}",
            "lengthen duration or change it",
        )  # fmt: skip
    readings, pixels = setup.cycles // every + 1, setup.shape[0] * setup.shape[1]
    if readings * pixels > _MOST:
        raise InputError(
            "sensor.sub_threshold.limit", f"so long that {_MOST // pixels} readings are enough",
            f"{readings} readings", "lengthen it, or shorten duration",
        )  # fmt: skip
    return every


def reading_camera(camera: SpikeCamera, setup: CameraSetup) -> SpikeCamera | ReadingCamera:
    """The camera of a run, which also reads the charge if the scenario has it do so. Raises
    InputError for readings or a dark limit that the run cannot have."""
    dark_cycles(setup.scenario.sensor, setup.setting)
    section = setup.scenario.sensor.sub_threshold
    if section is None:
        return camera
    return ReadingCamera(camera, setup.setting, _every(setup), section.levels)


def dark_cycles(section: SensorSection, setting: CameraSetting) -> float:
    """Width in cycles from which on an interval is rejected; infinite for none. Raises InputError
    if the device whose dark current decides has none."""
    if section.dark_limit is None:
        return math.inf
    seconds = section.dark_limit
    if not seconds:
        dark = 0.0 if setting.pattern is None else setting.pattern.dark
        if not dark:
            raise InputError(
                "sensor.pattern.dark_current", "above 0 with sensor.dark_limit = 'dark current'",
                "0 e/s", "give it, or a duration as sensor.dark_limit",
            )  # fmt: skip
        seconds = longest_width(setting.threshold, dark)
    return seconds * setting.clock.hz


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
    section = setup.scenario.sensor.sub_threshold
    return None if section is None else spike_dynamic_range(_every(setup), 1, section.levels)


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
